// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "assembly_cell/base/yaml_section.h"
#include "scenario_text.h"

namespace assembly_cell {
namespace {

// Each override makes the scenario wrong in one way; the line names the path, the value, the
// remedy.
struct WrongOverride {
  const char* override_text;
  const char* path;
  const char* says;
};

void expectRefusals(const std::vector<WrongOverride>& cases) {
  for (const auto& c : cases) {
    const std::string error = errorOf(kBase, {c.override_text});
    EXPECT_NE(error.find(c.path), std::string::npos) << c.override_text << " -> " << error;
    EXPECT_NE(error.find(c.says), std::string::npos) << c.override_text << " -> " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    EXPECT_TRUE(error.rfind("file.yaml: ", 0) == 0 || error.rfind("--set", 0) == 0) << error;
  }
}

TEST(Scenario, RefusesWhatIsMalformedByItsPath) {
  expectRefusals({
      // unknown, also of keys the format does not know at all
      {"colour=red", "colour: value red", "unknown key, known here: name, duration"},
      {"peg.raduis=0.02", "peg.raduis: value 0.02", "unknown key"},
      {"coupling.stiffness.c26=1", "coupling.stiffness.c26", "unknown key"},
      {"initial.peg.psi=1", "initial.peg.position: value missing", "list of 3"},
      {"initial.velocity=[0, 0, 0]", "initial.velocity", "unknown key"},
      {"solver.method=rk4", "solver.method: value rk4", "unknown key"},
      // types
      {"name=[a]", "name: value a list of 1", "name"},
      {"name=", "name: value empty", "name"},
      {"duration=soon", "duration: value soon", "number"},
      {"duration='1'", "duration: value 1", "number"},
      {"duration=\"1\"", "duration: value 1", "number"},
      {"duration=0x10", "duration: value 0x10", "number"},
      {"duration=1_000", "duration: value 1_000", "number"},
      {"duration=1,5", "duration: value 1,5", "number"},
      {"duration=+-1", "duration: value +-1", "number"},
      {"duration=true", "duration: value true", "number"},
      {"duration=", "duration: value empty", "number"},
      {"duration=[1]", "duration: value a list of 1", "number"},
      {"peg=3", "peg: value 3", "mapping"},
      {"peg=", "peg: value empty", "mapping"},
      {"peg=[1]", "peg: value a list of 1", "mapping"},
      {"contact.stationary_rows=yes", "contact.stationary_rows: value yes", "true or false"},
      {"contact.stationary_rows=1", "contact.stationary_rows: value 1", "true or false"},
      {"contact.stationary_rows='true'", "contact.stationary_rows: value true", "true or false"},
      {"initial.close=on", "initial.close: value on", "true or false"},
      // sizes
      {"hole.radius_tolerance=0.02", "hole.radius_tolerance: value 0.02",
       "give a list of 2 numbers, the smallest and the largest radius"},
      {"carrier.stiffness=[1, 2]", "carrier.stiffness: value a list of 2", "3 numbers"},
      {"carrier.damping=[1, 2, 3, 4]", "carrier.damping: value a list of 4", "3 numbers"},
      {"coupling.stiffness.diagonal=[]", "coupling.stiffness.diagonal", "6 numbers"},
      {"push=5", "push: value 5", "3 numbers"},
      // not finite
      {"duration=.nan", "duration: value .nan", "finite"},
      {"duration=.inf", "duration: value .inf", "finite"},
      {"gravity=-.inf", "gravity: value -.inf", "finite"},
      {"gravity=nan", "gravity: value nan", "finite"},
      {"gravity=inf", "gravity: value inf", "finite"},
      {"gravity=1e999", "gravity: value 1e999", "finite"},
      {"hole.depth=.inf", "hole.depth: value .inf", "finite"},
      {"push[1]=.nan", "index: value 1", "give the whole list"},
  });
}

TEST(Scenario, RefusesWhatIsUnphysicalByItsPath) {
  expectRefusals({
      // unphysical
      {"duration=-1", "duration: value -1", ">= 0"},
      {"gravity=-9.8", "gravity: value -9.8", ">= 0"},
      {"peg.radius=0", "peg.radius: value 0", "> 0"},
      {"peg.half_height=-0.03", "peg.half_height", "> 0"},
      {"peg.mass=0", "peg.mass: value 0", "> 0"},
      {"peg.inertia_transverse=0", "peg.inertia_transverse", "> 0"},
      {"peg.inertia_axial=5.1e-4", "peg.inertia_axial: value 0.00051", "twice"},
      {"hole.radius=-1", "hole.radius", "> 0"},
      {"hole.depth=0", "hole.depth", "> 0"},
      {"hole.chamfer={width: -1e-4}", "hole.chamfer.width: value -1e-4", "from 0"},
      {"hole.chamfer={width: 1e-3, angle: 2}", "hole.chamfer.angle: value 2", "1.4"},
      {"hole={radius: 0.0251, depth: 5e-4, chamfer: {width: 1e-3}}",
       "hole.chamfer.width: value 0.001", "0.0005; give less"},
      {"hole.chamfer={width: 0.02}", "hole.chamfer.width: value 0.02",
       "the block's wall is 0.0199 m wide; give less"},
      {"hole.chamfer={width: 1e-3, angle: 0}", "hole.chamfer.angle: value 0", "0.1"},
      {"hole.chamfer={angle: 0.5}", "hole.chamfer.width", "missing"},
      {"hole.radius_tolerance=[0.0252, 0.025]", "hole.radius_tolerance[0]: value 0.0252",
       "give the smaller radius first, then the larger; the second is 0.025"},
      {"peg.radius_tolerance=[0.02498, 0.02499]", "peg.radius: value 0.025",
       "not within peg.radius_tolerance, 0.02498 to 0.02499 m; correct one of them"},
      {"peg.radius_tolerance=[0, 0.025]", "peg.radius_tolerance[0]: value 0", "> 0"},
      {"peg.radius_tolerance=0.025", "peg.radius_tolerance: value 0.025", "list of 2 numbers"},
      {"carrier.mass=0", "carrier.mass", "> 0"},
      {"carrier.inertia=0", "carrier.inertia", "> 0"},
      {"carrier.stiffness[1]=-1", "carrier.stiffness[1]: value -1", ">= 0"},
      {"carrier.damping.2=-1", "carrier.damping[2]: value -1", ">= 0"},
      {"carrier.max_speed=0", "carrier.max_speed", "> 0"},
      {"carrier.max_acceleration=0", "carrier.max_acceleration", "> 0"},
      {"coupling.stiffness.diagonal[0]=-1", "coupling.stiffness.diagonal[0]", ">= 0"},
      {"coupling.damping.diagonal[5]=-1", "coupling.damping.diagonal[5]", ">= 0"},
      {"coupling.stiffness.k26=34.7", "coupling.stiffness.k26: value 34.7", "semidefinite"},
      {"coupling.stiffness.k35=-38.8", "coupling.stiffness.k35: value -38.8", "semidefinite"},
      {"coupling.damping.c26=3.5", "coupling.damping.c26: value 3.5", "semidefinite"},
      {"coupling.damping.c35=3.9", "coupling.damping.c35: value 3.9", "semidefinite"},
      {"coupling.axes=peg", "coupling.axes: value peg", "carrier"},
      {"coupling.rest.theta=0.1", "coupling.rest.theta: value 0.1", "sin(theta)"},
      {"coupling.rest.theta=-1.57", "coupling.rest.theta: value -1.57", "sin(theta)"},
      {"exciter={amplitude: -1, frequency: 1}", "exciter.amplitude", ">= 0"},
      {"exciter={amplitude: 1, frequency: -1}", "exciter.frequency", "from 0"},
      {"exciter={amplitude: 1, frequency: 1, direction: 0}", "exciter.direction", "-1"},
      {"exciter={amplitude: 1, frequency: 1, direction: 2}", "exciter.direction", "-1"},
      {"exciter={amplitude: 1}", "exciter.frequency: value missing", "number"},
      {"friction.static=-0.1", "friction.static", ">= 0"},
      {"friction.sliding=0.31", "friction.sliding: value 0.31", "friction.static (0.3)"},
      {"contact.law=sticky", "contact.law: value sticky", "viscous"},
      {"contact={law: viscous}", "contact.rate: value missing", "> 0"},
      {"contact={law: spring_dashpot, damping: 1}", "contact.stiffness: value missing", "> 0"},
      {"contact={law: spring_dashpot, stiffness: 1}", "contact.damping: value missing", ">= 0"},
      {"contact.rate=0", "contact.rate", "> 0"},
      {"contact.regularisation_speed=0", "contact.regularisation_speed", "> 0"},
      {"contact.pull_back=-1", "contact.pull_back", ">= 0"},
      {"contact.restitution=1.1", "contact.restitution: value 1.1", "0 to 1"},
      {"contact.features=edge_edge", "contact.features", "list"},
      {"contact.features=[edge_edge, face]", "contact.features[1]: value face",
       "available are edge_edge, edge_plane, edge_wall, rim_side, rim_face, edge_cone and "
       "rim_cone"},
      {"thesis_moments=1", "thesis_moments: value 1", "true or false"},
      {"contact.features=[corner]", "contact.features[0]: value corner", "unknown contact"},
      {"contact.features=[edge_edge, edge_edge]", "contact.features[1]", "twice"},
      {"initial.peg={position: [0, 0, 1], euler: [0, 0, 0]}", "initial.peg.euler[1]: value 0",
       "sin(theta)"},
      {"initial.carrier={x: 0, y: 0}", "initial.carrier.yaw: value missing", "number"},
      {"solver.tolerance=0", "solver.tolerance", "from 1e-14 to 0.001"},
      {"solver.tolerance=1e-30", "solver.tolerance", "from 1e-14 to 0.001"},
      {"solver.tolerance=1", "solver.tolerance", "from 1e-14 to 0.001"},
      {"solver.max_step=-1", "solver.max_step", "> 0"},
      {"solver.step=0", "solver.step", "> 0"},
      // sizes with which a run has no end
      {"duration=1e9", "duration: value 1000000000", "solver.max_step or solver.step (0.0002)"},
      {"solver.max_step=1e-300", "duration: value", "longer steps"},
      {"peg.radius=25", "peg.radius: value 25", "at most 1 [m]"},
      {"coupling.rest.z=-1e9", "coupling.rest.z: value -1e9", "from -1000 to 1000 [m]"},
      {"carrier.rest.yaw=1e9", "carrier.rest.yaw: value 1e9", "to 1000 [rad]"},
      {"initial.peg={position: [0, 1e9, 0], euler: [0, 1.57, 0]}", "initial.peg.position[1]",
       "to 1000 [m]"},
      {"exciter={amplitude: 0, frequency: 1e9}", "exciter.frequency: value 1e9",
       "to 1000000 [rad/s]"},
      {"solver.integrator=[a]", "solver.integrator", "dopri5"},
  });
}

TEST(Scenario, RefusesFitsThatItDoesNotHave) {
  const char* const remedy =
      ": give hole and shaft by ISO 286, such as H7/g6: D to H or JS, d to h, js, k, m, n or p, "
      "each "
      "with a grade from 5 to 11";
  for (const char* name : {"H7", "H7/q6", "h6/H7", "H7/g6x", "H4/g6", "H12/g6", "A7/g6"}) {
    EXPECT_EQ(errorOf(kBase, {std::string("hole={radius: 0.025, fit: ") + name + "}"}),
              std::string("file.yaml: hole.fit: value ") + name + remedy);
  }
  EXPECT_EQ(errorOf(kBase, {"hole.fit=H7/g6"}),
            "file.yaml: hole.fit: value H7/g6: hole.radius 0.0251 and peg.radius 0.025 m are in no "
            "zones of this fit; correct them, or give both the nominal radius");
  EXPECT_EQ(
      errorOf(kBase, {"hole.radius=0.2", "peg.radius=0.2", "hole.fit=H7/g6"}),
      "file.yaml: hole.fit: value H7/g6: hole.radius is 0.2 m, and fits are tabulated up to a "
      "diameter of 180 mm; give radius_tolerance of hole and peg in its place");
  for (const char* part : {"hole", "peg"}) {
    EXPECT_EQ(errorOf(kBase, {"hole={radius: 0.025, fit: H7/g6}",
                              std::string(part) + ".radius_tolerance=[0.02, 0.03]"}),
              "file.yaml: hole.fit: value H7/g6: it determines radius_tolerance of hole and peg, "
              "leave one of them out");
  }
}

// 1 um/N and 1 mrad/(N m) each; entry `at` and its mirror are others.
std::string complianceRows(int at, int mirror, double value, double mirrored) {
  std::string rows;
  for (int i = 0; i < 36; ++i) {
    const double plain = i % 7 != 0 ? 0.0 : i < 18 ? 1e-6 : 1e-3;
    rows += (i == 0 ? "[" : ", ") + yaml::shown(i == at ? value : i == mirror ? mirrored : plain);
  }
  return rows + "]";
}

TEST(Scenario, RefusesAComplianceThatIsNone) {
  const std::string base = kBase;
  const std::size_t at = base.find("coupling:\n"), damping = base.find("  damping:", at);
  ASSERT_LT(damping, base.find("rest:", at));
  const auto refusal = [&](const std::string& given) {
    std::string text = base;
    text.replace(at, damping - at, "coupling:\n" + given);
    try {
      parseScenario(text, "file.yaml");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  const std::string rows = complianceRows(-1, -1, 0.0, 0.0);
  EXPECT_EQ(refusal("  compliance: " + rows + "\n"), "none");
  const struct {
    std::string given;
    const char *key, *remedy;
  } cases[] = {
      {"", "coupling.stiffness", "missing"},
      {"  compliance: [1, 2, 3]\n", "coupling.compliance", "a list of 3: give a list of 36"},
      {"  compliance: stiff\n", "coupling.compliance: value stiff", "36"},
      {"  compliance: " + complianceRows(1, 6, 1e-7, 0.0) + "\n",
       "coupling.compliance: value 1e-07", "(1, 2) differs from (2, 1)"},
      {"  compliance: " + complianceRows(0, -1, 0.0, 0.0) + "\n", "coupling.compliance: value 0",
       "(1, 1) is not above 0"},
      {"  compliance: " + complianceRows(21, -1, -1e-3, 0.0) + "\n",
       "coupling.compliance: value -0.001", "positive definite"},
      {"  compliance: " + complianceRows(1, 6, 2e-6, 2e-6) + "\n",
       "coupling.compliance: value -1: lowest eigenvalue", "positive definite"},
      {"  compliance: " + complianceRows(3, 18, 3.2e-5, 3.2e-5) + "\n",
       "coupling.compliance: value -0.0119", "positive definite"},
      {"  compliance: " + rows + "\n  stiffness: {diagonal: [1, 1, 1, 1, 1, 1], k26: 0, k35: 0}\n",
       "coupling.compliance", "coupling.stiffness is given, too"},
      {"  stiffness: {diagonal: [1, 1, 1, 1, 1, 1], k26: 0, k35: 0, cross: [1.1, 0, 0, 0, 0, 0, 0, "
       "0, 0, 0, 0, 0, 0]}\n",
       "coupling.stiffness.cross: value -0.1", "lowest eigenvalue"},
      {"  stiffness: {diagonal: [0, 1, 1, 1, 1, 1], k26: 0, k35: 0, cross: [0.1, 0, 0, 0, 0, 0, 0, "
       "0, 0, 0, 0, 0, 0]}\n",
       "coupling.stiffness.cross: value 0.1", "give 0"},
  };
  for (const auto& c : cases) {
    const std::string text = refusal(c.given);
    EXPECT_NE(text.find(c.key), std::string::npos) << text;
    EXPECT_NE(text.find(c.remedy), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos);
  }
}

// Every key of the base file is needed: without it the line names the key.
TEST(Scenario, RefusesEachMissingKey) {
  const char* const keys[] = {"name",
                              "duration",
                              "gravity",
                              "peg",
                              "peg.radius",
                              "peg.half_height",
                              "peg.mass",
                              "peg.inertia_transverse",
                              "peg.inertia_axial",
                              "peg.coupling_height",
                              "peg.exciter_height",
                              "hole",
                              "hole.radius",
                              "carrier",
                              "carrier.mass",
                              "carrier.inertia",
                              "carrier.stiffness",
                              "carrier.damping",
                              "carrier.rest",
                              "carrier.rest.x",
                              "carrier.rest.y",
                              "carrier.rest.yaw",
                              "coupling",
                              "coupling.stiffness",
                              "coupling.stiffness.diagonal",
                              "coupling.stiffness.k26",
                              "coupling.stiffness.k35",
                              "coupling.damping",
                              "coupling.damping.diagonal",
                              "coupling.damping.c26",
                              "coupling.damping.c35",
                              "coupling.rest",
                              "coupling.rest.z",
                              "coupling.rest.theta",
                              "coupling.rest.phi",
                              "friction",
                              "friction.static",
                              "friction.sliding",
                              "contact",
                              "contact.law",
                              "contact.rate"};
  for (const std::string key : keys) {
    // rename the key in the text: the first occurrence after its parents'
    std::string text = kBase;
    std::size_t at = 0;
    std::istringstream path(key);
    std::string word;
    while (std::getline(path, word, '.')) {
      const std::size_t from = at;
      at = text.find(word + ":", from);
      ASSERT_NE(at, std::string::npos) << key;
    }
    text.insert(at, "x_");
    const std::string error = errorOf(text);
    EXPECT_NE(error.find("file.yaml: " + key + ": value missing"), std::string::npos)
        << key << " -> " << error;
  }
}

TEST(Scenario, RefusesWhatIsNoScenario) {
  const struct {
    const char* text;
    const char* says;
  } cases[] = {
      {"", "file: value empty"},
      {"# only a comment\n", "file: value empty"},
      {"just words", "file: value just words"},
      {"[1, 2]", "file: value a list of 2"},
      {"name: a\npeg: {radius: 1\n", "line 3"},
      {"name: a\n\tpeg: 1\n", "line 2"},
      {"a: 1\n---\nb: 2\n", "2 documents"},
      {"[a]: 1\n", "plain word"},
      {"name: *nowhere\n", "line 1"},
  };
  for (const auto& c : cases) {
    const std::string error = errorOf(c.text);
    EXPECT_EQ(error.rfind("file.yaml: ", 0), 0u) << c.text << " -> " << error;
    EXPECT_NE(error.find(c.says), std::string::npos) << c.text << " -> " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
}

TEST(Scenario, RefusesDuplicateKeys) {
  const std::string top = errorOf(std::string(kBase) + "duration: 0.3\n");
  EXPECT_NE(top.find("duration: value 0.3: duplicate key"), std::string::npos) << top;
  std::string text = kBase;
  text.replace(text.find("half_height"), 0, "radius: 0.03, ");
  EXPECT_NE(errorOf(text).find("peg.radius: value 0.03: duplicate key"), std::string::npos);
  // an override of another key does not hide it
  EXPECT_NE(errorOf(text, {"peg.mass=1"}).find("duplicate key"), std::string::npos);
}

TEST(Scenario, MessagesStayOneShortLine) {
  const std::string error =
      errorOf(std::string(kBase) + "\"odd\\nkey\": \"" + std::string(5000, 'x') + "\\n\"\n");
  EXPECT_EQ(error.find('\n'), std::string::npos);
  EXPECT_LT(error.size(), 500u);
}

TEST(Scenario, RefusesOverridesThatLeadNowhere) {
  const struct {
    const char* text;
    const char* says;
  } cases[] = {
      {"duration", "write key.path=value"},
      {"=1", "write key.path=value"},
      {"peg..radius=1", "write key.path=value"},
      {"push[1=2", "write key.path=value"},
      {"push]1=2", "write key.path=value"},
      {"push[1]x=2", "write key.path=value"},
      {"push[[1]]=2", "write key.path=value"},
      {"push[1.2]=2", "write key.path=value"},
      {"peg.radius.x=1", "nothing below 0.025"},
      {"coupling.stiffness.diagonal[6]=1", "index from 0 to 5"},
      {"coupling.stiffness.diagonal[-1]=1", "index from 0"},
      {"coupling.stiffness.diagonal.first=1", "index from 0"},
      {"push={1, 2", "not YAML"},
  };
  for (const auto& c : cases) {
    const std::string error = errorOf(kBase, {c.text});
    EXPECT_NE(error.find(c.says), std::string::npos) << c.text << " -> " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
}

}  // namespace
}  // namespace assembly_cell
