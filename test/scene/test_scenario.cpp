// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {
namespace {

// A complete scenario of which the cases below change one thing each.
const char* const kBase = R"(name: base
duration: 0.3
gravity: 9.8
peg: {radius: 0.025, half_height: 0.030, mass: 0.395, inertia_transverse: 2.5e-4,
      inertia_axial: 1.0e-4, coupling_height: 0.050, exciter_height: 0.056}
hole: {radius: 0.0251}
carrier: {mass: 0.395, inertia: 0.081, stiffness: [1, 2, 3], damping: [4, 5, 6],
          rest: {x: 0.001, y: 0.002, yaw: 0.3}}
coupling:
  stiffness: {diagonal: [10, 20, 30, 40, 50, 60], k26: 7, k35: -8}
  damping: {diagonal: [1, 2, 3, 4, 5, 6], c26: 0.7, c35: -0.8}
  rest: {z: 0.075, theta: 1.6, phi: 0.02}
friction: {static: 0.3, sliding: 0.2}
contact: {law: viscous, rate: 700}
)";

std::string errorOf(const std::string& yaml, const std::vector<std::string>& overrides = {}) {
  try {
    parseScenario(yaml, "file.yaml", overrides);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

Scenario with(const std::vector<std::string>& overrides) {
  return parseScenario(kBase, "file.yaml", overrides);
}

std::string configPath(const std::string& name) {
  return (std::filesystem::path(ASSEMBLY_CELL_SOURCE_DIR) / "config" / "scenarios" / name).string();
}

TEST(Scenario, EveryKeyArrivesInItsField) {
  const Scenario s = with(
      {"hole.depth=0.05", "carrier.max_speed=0.07", "carrier.max_acceleration=2",
       "exciter={amplitude: 1.5, frequency: 770, phase: 0.4, direction: -1}", "push=[1, -2, 3]",
       "contact={law: spring_dashpot, regularisation_speed: 0.002, stationary_rows: true, "
       "stiffness: 1e5, damping: 200, rate: 800, pull_back: 15, restitution: 0.5, "
       "features: [edge_plane]}",
       "initial={close: true, peg: {position: [1, 2, 3], euler: [0.1, 1.5, 0.3], "
       "velocity: [4, 5, 6], euler_rates: [7, 8, 9]}, carrier: {x: 10, y: 11, yaw: 12, "
       "velocity: [13, 14, 15]}}",
       "solver={integrator: rk4, tolerance: 1e-8, max_step: 1e-3, step: 1e-5}"});
  EXPECT_EQ(s.name, "base");
  EXPECT_EQ(s.duration, 0.3);
  EXPECT_EQ(s.mechanism.gravity, 9.8);
  EXPECT_EQ(s.mechanism.peg.radius, 0.025);
  EXPECT_EQ(s.mechanism.peg.half_height, 0.030);
  EXPECT_EQ(s.mechanism.peg.mass, 0.395);
  EXPECT_EQ(s.mechanism.peg.inertia_transverse, 2.5e-4);
  EXPECT_EQ(s.mechanism.peg.inertia_axial, 1.0e-4);
  EXPECT_EQ(s.mechanism.peg.coupling_height, 0.050);
  EXPECT_EQ(s.mechanism.peg.exciter_height, 0.056);
  EXPECT_EQ(s.mechanism.hole.radius, 0.0251);
  EXPECT_EQ(s.mechanism.hole.depth, 0.05);
  EXPECT_EQ(s.mechanism.carrier.mass, 0.395);
  EXPECT_EQ(s.mechanism.carrier.inertia, 0.081);
  EXPECT_EQ(s.mechanism.carrier.stiffness, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(s.mechanism.carrier.damping, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(s.mechanism.carrier.max_speed, 0.07);
  EXPECT_EQ(s.mechanism.carrier.max_acceleration, 2.0);
  EXPECT_EQ(s.mechanism.coupling.stiffness.diagonal,
            (Vector6() << 10, 20, 30, 40, 50, 60).finished());
  EXPECT_EQ(s.mechanism.coupling.stiffness.k26, 7.0);
  EXPECT_EQ(s.mechanism.coupling.stiffness.k35, -8.0);
  EXPECT_EQ(s.mechanism.coupling.damping.diagonal, (Vector6() << 1, 2, 3, 4, 5, 6).finished());
  EXPECT_EQ(s.mechanism.coupling.damping.k26, 0.7);
  EXPECT_EQ(s.mechanism.coupling.damping.k35, -0.8);
  EXPECT_EQ(s.rest.x, 0.001);
  EXPECT_EQ(s.rest.y, 0.002);
  EXPECT_EQ(s.rest.z, 0.075);
  EXPECT_EQ(s.rest.yaw, 0.3);
  EXPECT_EQ(s.rest.theta, 1.6);
  EXPECT_EQ(s.rest.phi, 0.02);
  EXPECT_EQ(s.mechanism.exciter.amplitude, 1.5);
  EXPECT_EQ(s.mechanism.exciter.frequency, 770.0);
  EXPECT_EQ(s.mechanism.exciter.phase, 0.4);
  EXPECT_EQ(s.mechanism.exciter.direction, -1);
  EXPECT_EQ(s.push, Eigen::Vector3d(1, -2, 3));
  EXPECT_EQ(s.mechanism.friction.static_coefficient, 0.3);
  EXPECT_EQ(s.mechanism.friction.sliding_coefficient, 0.2);
  EXPECT_EQ(s.contact.law, ContactLaw::kSpringDashpot);
  EXPECT_EQ(s.contact.regularisation_speed, 0.002);
  EXPECT_TRUE(s.contact.stationary_rows);
  EXPECT_EQ(s.contact.stiffness, 1e5);
  EXPECT_EQ(s.contact.damping, 200.0);
  EXPECT_EQ(s.contact.rate, 800.0);
  EXPECT_EQ(s.contact.pull_back, 15.0);
  EXPECT_EQ(s.contact.restitution, 0.5);
  EXPECT_FALSE(s.contact.features.edge_edge);
  EXPECT_TRUE(s.contact.features.edge_plane);
  EXPECT_TRUE(s.initial.close);
  EXPECT_EQ(s.initial.position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(s.initial.euler.phi, 0.1);
  EXPECT_EQ(s.initial.euler.theta, 1.5);
  EXPECT_EQ(s.initial.euler.psi, 0.3);
  EXPECT_EQ(s.initial.velocity, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(s.initial.euler_rates, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(s.initial.carrier_x, 10.0);
  EXPECT_EQ(s.initial.carrier_y, 11.0);
  EXPECT_EQ(s.initial.carrier_yaw, 12.0);
  EXPECT_EQ(s.initial.carrier_velocity, Eigen::Vector3d(13, 14, 15));
  EXPECT_EQ(s.solver.integrator, "rk4");
  EXPECT_EQ(s.solver.tolerance, 1e-8);
  EXPECT_EQ(s.solver.max_step, 1e-3);
  EXPECT_EQ(s.solver.step, 1e-5);
}

TEST(Scenario, AbsentOptionalKeysTakeTheirDefaults) {
  const Scenario s = with({});
  const Scenario defaults;
  EXPECT_TRUE(std::isinf(s.mechanism.hole.depth));
  EXPECT_EQ(s.mechanism.exciter.amplitude, 0.0);
  EXPECT_EQ(s.push, Eigen::Vector3d::Zero());
  EXPECT_TRUE(s.contact.features.edge_edge);
  EXPECT_TRUE(s.contact.features.edge_plane);
  EXPECT_EQ(s.contact.regularisation_speed, defaults.contact.regularisation_speed);
  EXPECT_EQ(s.mechanism.carrier.max_speed, defaults.mechanism.carrier.max_speed);
  EXPECT_EQ(s.solver.integrator, defaults.solver.integrator);
  EXPECT_EQ(s.solver.tolerance, defaults.solver.tolerance);
}

// Stress-free: the coupling point of the peg lies at the carrier's rest point, angles agree.
TEST(Scenario, AbsentInitialStartsAtRestStressFree) {
  const Scenario s = with({});
  // axis of dynamics.md section 1 in axes x, y, z
  const Eigen::Vector3d axis(std::sin(0.02) * std::sin(1.6), std::cos(1.6),
                             std::cos(0.02) * std::sin(1.6));
  const Eigen::Vector3d coupling = s.initial.position + 0.050 * axis;
  EXPECT_LT((coupling - Eigen::Vector3d(0.001, 0.002, 0.075)).norm(), 1e-16);  // one rounding
  EXPECT_EQ(s.initial.euler.phi, 0.02);
  EXPECT_EQ(s.initial.euler.theta, 1.6);
  EXPECT_EQ(s.initial.euler.psi, 0.3);
  EXPECT_EQ(s.initial.carrier_x, 0.001);
  EXPECT_EQ(s.initial.carrier_y, 0.002);
  EXPECT_EQ(s.initial.carrier_yaw, 0.3);
  EXPECT_EQ(s.initial.velocity, Eigen::Vector3d::Zero());
  EXPECT_FALSE(s.initial.close);
}

TEST(Scenario, NumbersInEveryNotation) {
  const std::pair<const char*, double> cases[] = {
      {"1.0e5", 1e5}, {".5", 0.5},     {"5", 5.0},   {"1e-3", 1e-3}, {"+2.5", 2.5},
      {"3.", 3.0},    {"1E+2", 100.0}, {"007", 7.0}, {"0.1", 0.1},   {"!!float 4", 4.0}};
  for (const auto& [text, value] : cases) {
    EXPECT_EQ(with({std::string("duration=") + text}).duration, value) << text;
  }
  EXPECT_EQ(with({"push=[-.5, -0, -1.0e-3]"}).push, Eigen::Vector3d(-0.5, 0.0, -1e-3));
}

// Each override makes the scenario wrong in one way; the line names the path, the value, the
// remedy.
TEST(Scenario, RefusesWhatIsWrongByItsPath) {
  const struct {
    const char* override_text;
    const char* path;
    const char* says;
  } cases[] = {
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
      {"coupling.rest.theta=0.1", "coupling.rest.theta: value 0.1", "sin(theta)"},
      {"coupling.rest.theta=-1.57", "coupling.rest.theta: value -1.57", "sin(theta)"},
      {"exciter={amplitude: -1, frequency: 1}", "exciter.amplitude", ">= 0"},
      {"exciter={amplitude: 1, frequency: -1}", "exciter.frequency", ">= 0"},
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
       "available are edge_edge, edge_plane, edge_wall, rim_side and rim_face"},
      {"thesis_moments=1", "thesis_moments: value 1", "true or false"},
      {"contact.features=[corner]", "contact.features[0]: value corner", "unknown contact"},
      {"contact.features=[edge_edge, edge_edge]", "contact.features[1]", "twice"},
      {"initial.peg={position: [0, 0, 1], euler: [0, 0, 0]}", "initial.peg.euler[1]: value 0",
       "sin(theta)"},
      {"initial.carrier={x: 0, y: 0}", "initial.carrier.yaw: value missing", "number"},
      {"solver.tolerance=0", "solver.tolerance", "> 0"},
      {"solver.max_step=-1", "solver.max_step", "> 0"},
      {"solver.step=0", "solver.step", "> 0"},
      // sizes with which a run has no end
      {"duration=1e9", "duration: value 1000000000", "solver.max_step or solver.step (0.0002)"},
      {"solver.max_step=1e-300", "duration: value", "longer steps"},
      {"peg.radius=25000", "peg.radius: value 25000", "at most 1000"},
      {"coupling.rest.z=-1e9", "coupling.rest.z: value -1000000000", "at most 1000"},
      {"carrier.rest.yaw=1e9", "carrier.rest.yaw: value 1000000000", "at most 1000"},
      {"initial.peg={position: [0, 1e9, 0], euler: [0, 1.57, 0]}", "initial.peg.position[1]",
       "at most 1000"},
      {"exciter={amplitude: 0, frequency: 1e9}", "exciter.frequency: value 1000000000",
       "at most 1000000"},
      {"solver.integrator=[a]", "solver.integrator", "name of an integrator"},
  };
  for (const auto& c : cases) {
    const std::string error = errorOf(kBase, {c.override_text});
    EXPECT_NE(error.find(c.path), std::string::npos) << c.override_text << " -> " << error;
    EXPECT_NE(error.find(c.says), std::string::npos) << c.override_text << " -> " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    EXPECT_TRUE(error.rfind("file.yaml: ", 0) == 0 || error.rfind("--set", 0) == 0) << error;
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

TEST(Scenario, OverridesReachListsAndAbsentKeys) {
  EXPECT_EQ(with({"coupling.stiffness.diagonal[1]=99"}).mechanism.coupling.stiffness.diagonal,
            (Vector6() << 10, 99, 30, 40, 50, 60).finished());
  EXPECT_EQ(with({"coupling.stiffness.diagonal.1=98"}).mechanism.coupling.stiffness.diagonal[1],
            98.0);
  EXPECT_EQ(with({"carrier.max_speed=0.2"}).mechanism.carrier.max_speed, 0.2);
  EXPECT_TRUE(with({"initial.close=true"}).initial.close);
  EXPECT_EQ(with({"solver.step=1e-5"}).solver.step, 1e-5);
  // the last one counts, the value may hold an equals sign, and an earlier one may build its parent
  EXPECT_EQ(with({"duration=1", "duration=2"}).duration, 2.0);
  EXPECT_EQ(with({"name=a=b"}).name, "a=b");
  EXPECT_EQ(
      with({"exciter={amplitude: 1, frequency: 2}", "exciter.phase=3"}).mechanism.exciter.phase,
      3.0);
  EXPECT_EQ(with({"push=[1, 2, 3]", "push[2]=4"}).push, Eigen::Vector3d(1, 2, 4));
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

// carrier.damping and carrier.stiffness share one YAML node here.
TEST(Scenario, OverrideOfAnAliasedListChangesOnePlace) {
  std::string text = kBase;
  text.replace(text.find("stiffness: [1, 2, 3], damping: [4, 5, 6]"), 41,
               "stiffness: &k [1, 2, 3], damping: *k, ");
  const Scenario s = parseScenario(text, "file.yaml", {"carrier.damping[0]=9"});
  EXPECT_EQ(s.mechanism.carrier.stiffness, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(s.mechanism.carrier.damping, Eigen::Vector3d(9, 2, 3));
}

TEST(Scenario, UnreadableFilesAreRefusedByOneLine) {
  const std::string here = std::filesystem::temp_directory_path().string();
  for (const std::string& path : {here, here + "/no such file.yaml", std::string("/dev/zero")}) {
    try {
      loadScenario(path);
      ADD_FAILURE() << path;
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).rfind(path + ": file: value ", 0), 0u) << e.what();
    }
  }
}

TEST(Scenario, ShippedScenariosAreAccepted) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(configPath(""))) {
    EXPECT_NO_THROW(loadScenario(entry.path().string())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 4);
}

// The default cell: bottom edge centre and tilt as its first lines say, lowest point 3 mm up.
TEST(Scenario, DefaultCellIsMisalignedAsItSays) {
  const Scenario s = loadScenario(configPath("cell.yaml"));
  const Eigen::Vector3d axis = rotationFromEuler(s.initial.euler).col(2);
  const Eigen::Vector3d bottom = s.initial.position - s.mechanism.peg.half_height * axis;
  // 0.05 mm and 0.01 rad·1e-1: the figures are rounded to one decimal
  EXPECT_NEAR(bottom.x(), 4.2e-3, 5e-5);
  EXPECT_NEAR(bottom.y(), -2.7e-3, 5e-5);
  const double tilt = std::acos(axis.z());
  EXPECT_NEAR(tilt * 180.0 / M_PI, 1.0, 0.05);
  EXPECT_NEAR(bottom.z() - s.mechanism.peg.radius * std::sin(tilt), 3e-3, 5e-5);
}

// Random damage to a good file ends in a scenario or in one line, never in another exception.
TEST(Scenario, DamagedTextIsReadOrRefused) {
  std::mt19937 random(7);
  for (int run = 0; run < 3000; ++run) {
    std::string text = kBase;
    const int edits = 1 + static_cast<int>(random() % 4);
    for (int i = 0; i < edits; ++i) {
      const std::size_t at = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          text.erase(at, 1 + random() % 30);
          break;
        default:
          text.insert(at, 1, "{}[]:,&*!|>'\"%@`#-?\n\t\0"[random() % 23]);
      }
      if (text.empty()) break;
    }
    const std::string error = errorOf(text);
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
}

}  // namespace
}  // namespace assembly_cell
