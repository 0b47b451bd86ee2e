// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/description/part_pairs.h"
#include "assembly_cell/description/urdf_text.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {
namespace {

const std::string kSource = ASSEMBLY_CELL_SOURCE_DIR;

std::string defaultUrdf() {
  std::ifstream file(kSource + "/urdf/cell.urdf");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// The cell's URDF with one piece of text replaced, in its first place after `after`.
std::string changed(const std::string& after, const std::string& from, const std::string& to) {
  std::string text = defaultUrdf();
  const std::size_t start = text.find(after);
  const std::size_t at = start == std::string::npos ? start : text.find(from, start);
  if (at == std::string::npos) {
    ADD_FAILURE() << "no \"" << from << "\" after \"" << after << "\"";
    return text;
  }
  return text.replace(at, from.size(), to);
}

template <typename Function>
std::string errorOf(const Function& function) {
  try {
    function();
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(CellDescription, ReadsTheDefaultCell) {
  const CellDescription cell = loadCellDescription(defaultUrdf());
  EXPECT_EQ(cell.peg.radius, 0.025);
  EXPECT_EQ(cell.peg.half_height, 0.030);
  EXPECT_EQ(cell.peg.mass, 0.395);
  EXPECT_EQ(cell.peg.inertia_transverse, 2.5e-4);
  EXPECT_EQ(cell.peg.inertia_axial, 1.0e-4);
  // differences of two decimal numbers: a rounding of 0.1
  EXPECT_NEAR(cell.peg.coupling_height, 0.050, 2e-17);
  EXPECT_NEAR(cell.peg.exciter_height, 0.056, 2e-17);
  EXPECT_EQ(cell.hole.radius, 0.0251);
  EXPECT_EQ(cell.hole.depth, 0.06);
  EXPECT_EQ(cell.carrier_mass, 0.395);
  EXPECT_EQ(cell.carrier_inertia, 1.0e-3);
  EXPECT_GT(cell.hole_block_mass, 0.0);
  EXPECT_EQ(cell.hole_block_centre, Eigen::Vector3d(0, 0, -0.03));
  EXPECT_EQ((cell.X_WA * cell.X_AH).p, Eigen::Vector3d(0, 0, 0.09));
  EXPECT_EQ(cell.X_BP.p, Eigen::Vector3d(0, 0, -0.080));
}

TEST(CellDescription, AgreesWithTheDefaultScenario) {
  const Scenario scenario = loadScenario(kSource + "/config/scenarios/cell.yaml");
  EXPECT_NO_THROW(
      checkAgainst(loadCellDescription(defaultUrdf()), scenario.mechanism, scenario.name));
}

// made from the scenario instead: urdf/cell.urdf to its printed digits
TEST(CellDescription, IsMadeFromTheScenario) {
  const Scenario scenario = loadScenario(kSource + "/config/scenarios/cell.yaml");
  const CellDescription made = loadCellDescription(cellUrdf(scenario.mechanism));
  const CellDescription drawn = loadCellDescription(defaultUrdf());
  EXPECT_NO_THROW(checkAgainst(made, scenario.mechanism, scenario.name));
  EXPECT_NEAR(made.hole_block_mass, drawn.hole_block_mass, 5e-4);
  EXPECT_LT((made.hole_block_centre - drawn.hole_block_centre).norm(), 1e-12);
  EXPECT_LT((made.X_AH.p - drawn.X_AH.p).norm(), 1e-12);
  const auto same = [](const std::vector<Part>& a, const std::vector<Part>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].shapes.size(), b[i].shapes.size()) << a[i].link;
      for (std::size_t k = 0; k < a[i].shapes.size(); ++k) {
        EXPECT_LT((a[i].shapes[k].X_PS.p - b[i].shapes[k].X_PS.p).norm(), 1e-6) << a[i].link;
        EXPECT_LT((a[i].shapes[k].size - b[i].shapes[k].size).norm(), 1e-6) << a[i].link;
      }
    }
  };
  same(made.fixed_parts, drawn.fixed_parts);
  same(made.moving_parts, drawn.moving_parts);
}

// With a chamfer: the description knows it, the block weighs less by the cone's ring, and its
// shapes leave the cone free to a micrometre and no more.
// z of the world is up, however the hole is oriented.
TEST(CellDescription, WorldIsUprightWhereTheHoleIsNot) {
  for (const char* gravity :
       {"9.8", "[0, -9.8, 0]", "[9.8, 0, 0]", "[-9.8, 0, 0]", "[0, 0, 9.8]", "[3, -4, -5]"}) {
    const Mechanism m =
        loadMechanism(kSource + "/config/scenarios/cell.yaml", {std::string("gravity=") + gravity});
    const CellDescription cell = loadCellDescription(cellUrdf(m));
    const Eigen::Vector3d up = cell.X_WA.R * cell.X_AH.R * m.up;
    EXPECT_LT((up - Eigen::Vector3d::UnitZ()).norm(), 1e-12) << gravity;
  }
}

TEST(CellDescription, ChamferIsInTheBlock) {
  Mechanism mechanism = loadScenario(kSource + "/config/scenarios/cell.yaml").mechanism;
  const CellDescription sharp = loadCellDescription(cellUrdf(mechanism));
  for (const double angle : {0.3, M_PI / 4, 1.2}) {
    HoleParameters& hole = mechanism.hole;
    hole.chamfer_width = 3e-3;
    hole.chamfer_angle = angle;
    const CellDescription cell = loadCellDescription(cellUrdf(mechanism));
    EXPECT_NO_THROW(checkAgainst(cell, mechanism, "cell"));
    EXPECT_NEAR(cell.hole.chamfer_width, 3e-3, 1e-14);
    EXPECT_NEAR(cell.hole.chamfer_angle, angle, 1e-11);
    const double R = hole.radius, M = R + 3e-3, deep = chamferDepth(hole);
    const double ring = M_PI * deep * ((M * M + M * R + R * R) / 3 - R * R);
    EXPECT_NEAR(sharp.hole_block_mass - cell.hole_block_mass, 2700 * ring, 1e-9);
    EXPECT_LT(cell.hole_block_centre.z(), sharp.hole_block_centre.z());
    // a small level box at the cone's face, in the middle of a generator
    const Part& block = cell.fixed_parts[1];
    PartShape probe;
    probe.size = Eigen::Vector3d(1e-6, 1e-6, 1e-6);
    const auto meets = [&](double beyond) {
      const double out = R + 1.5e-3 + beyond * std::cos(angle);
      probe.X_PS.p = Eigen::Vector3d(out, 0.0, -0.5 * deep - beyond * std::sin(angle));
      return std::any_of(block.shapes.begin(), block.shapes.end(),
                         [&](const PartShape& shape) { return shapesMeet(probe, shape); });
    };
    EXPECT_FALSE(meets(-5e-6)) << angle;
    EXPECT_TRUE(meets(5e-6)) << angle;
  }
  // one that isn't the scenario's, or reaches into the block
  std::string urdf = cellUrdf(mechanism);
  mechanism.hole.chamfer_width = 0.0;
  EXPECT_NE(errorOf([&] {
              checkAgainst(loadCellDescription(urdf), mechanism, "cell");
            }).find("hole.chamfer.width"),
            std::string::npos);
  const std::string mouth = "<visual name=\"chamfer\">";
  const std::size_t at = urdf.find("radius=\"", urdf.find(mouth)) + 8;
  urdf.replace(at, urdf.find('"', at) - at, "0.03");
  EXPECT_NE(errorOf([&] { loadCellDescription(urdf); }).find("reaches into the chamfer"),
            std::string::npos);
}

// A chamfered peg: known again, its shapes inside the cone and no farther from it than a step.
TEST(CellDescription, ChamferIsOnThePeg) {
  Mechanism mechanism = loadScenario(kSource + "/config/scenarios/cell.yaml").mechanism;
  for (const double angle : {0.3, M_PI / 4, 1.2}) {
    PegParameters& peg = mechanism.peg;
    peg.chamfer_width = 3e-3;
    peg.chamfer_angle = angle;
    const std::string urdf = cellUrdf(mechanism);
    const CellDescription cell = loadCellDescription(urdf);
    EXPECT_NO_THROW(checkAgainst(cell, mechanism, "cell"));
    EXPECT_NEAR(cell.peg.radius, peg.radius, 1e-14);
    EXPECT_NEAR(cell.peg.half_height, peg.half_height, 1e-14);
    EXPECT_NEAR(cell.peg.chamfer_width, 3e-3, 1e-14);
    EXPECT_NEAR(cell.peg.chamfer_angle, angle, 1e-11);
    PartShape probe;
    probe.size = Eigen::Vector3d(1e-6, 1e-6, 1e-6);
    const Part& part = cell.moving_parts.back();
    ASSERT_EQ(part.link, "peg");
    const auto meets = [&](double out) {
      // along the normal, from the middle of a generator
      probe.X_PS.p = Eigen::Vector3d(
          tipRadius(peg) + 1.5e-3 + out * std::cos(angle), 0.0,
          0.5 * chamferHeight(peg) - out * std::sin(angle) - peg.half_height - peg.coupling_height);
      return std::any_of(part.shapes.begin(), part.shapes.end(),
                         [&](const PartShape& shape) { return shapesMeet(probe, shape); });
    };
    EXPECT_FALSE(meets(5e-6)) << angle;
    EXPECT_TRUE(meets(-3e-3 / 8)) << angle;
    mechanism.peg.chamfer_width = 0.0;
    EXPECT_NE(errorOf([&] { checkAgainst(cell, mechanism, "cell"); }).find("peg.chamfer.width"),
              std::string::npos);
  }
}

// Each change breaks the description in one way; the line names the link or joint and its element.
TEST(CellDescription, RefusesMissingAndContradictoryValues) {
  const std::string peg = "<link name=\"peg\">";
  const std::string hole = "<link name=\"hole\">";
  const std::string carrier = "<link name=\"carrier\">";
  const struct {
    std::string after, from, to;
    const char* item;
    const char* says;
  } cases[] = {
      // not URDF
      {"", "<robot", "<rob", "file: value unreadable", "correct"},
      {peg, "0.395", "heavy", "file: value unreadable", "[heavy]"},
      {peg, "0.395", "nan", "file: value unreadable", "correct"},
      {peg, "0.025", "1e999", "file: value unreadable", "correct"},
      {peg, "<mass value=\"0.395\"/>", "", "file: value unreadable", "peg"},
      // links and joints
      {"<link name=\"exciter\"/>", "<link name=\"exciter\"/>", "", "file: value unreadable",
       "exciter"},
      {"", "link=\"sensor_b\"/><child link=\"peg\"", "link=\"carrier\"/><child link=\"peg\"",
       "joint sensor_b_to_peg: parent: value carrier", "sensor_b"},
      {"world_to_carrier", "floating", "fixed", "joint world_to_carrier: type", "floating"},
      {"sensor_b_to_peg", "fixed", "floating", "joint sensor_b_to_peg: type", "fixed"},
      {"sensor_b_to_peg", "rpy=\"0 0 0\"", "rpy=\"0.1 0 0\"", "joint sensor_b_to_peg: origin rpy",
       "0 0 0"},
      {"sensor_b_to_peg", "0 0 -0.080", "0.001 0 -0.080", "joint of peg: origin", "x and y"},
      {"sensor_b_to_peg", "0 0 -0.080", "0 0 -0.020", "joint of peg: origin z: value -0.02",
       "-0.03"},
      {"carrier_to_sensor_b", "0 0 0\"", "0 0 0.01\"", "joint of sensor_b: origin", "0 0 0"},
      {"peg_to_exciter", "0 0 0.086", "0 0.01 0.086", "joint of exciter: origin", "x and y"},
      // peg
      {peg, "<inertial>", "<inertial_>", "file: value unreadable", "correct"},
      {peg, "<mass value=\"0.395\"/>", "<mass value=\"0\"/>", "link peg: inertial: mass: value 0",
       "> 0"},
      {peg, "xyz=\"0 0 0.030\"/><mass", "xyz=\"0 0 0.031\"/><mass",
       "link peg: inertial: origin z: value 0.031", "0.03"},
      {peg, "ixx=\"2.5e-4\"", "ixx=\"2.6e-4\"",
       "link peg: inertia ixx, iyy: value 0.00026, 0.00025", "equal"},
      {peg, "ixy=\"0\"", "ixy=\"1e-6\"", "link peg: inertia: value (1e-06, 0, 0)", "must be 0"},
      {peg, "izz=\"1.0e-4\"", "izz=\"6e-4\"", "link peg: inertia izz: value 0.0006", "twice ixx"},
      {"<collision name=\"body\"><origin xyz=\"0 0 0.030\"/>", "length=\"0.060\"",
       "length=\"0.062\"", "link peg: collision: origin z: value 0.03", "0.031"},
      {"<collision name=\"body\"><origin xyz=\"0 0 0.030\"/>", "radius=\"0.025\"", "radius=\"-1\"",
       "link peg: collision body: size", "> 0"},
      {"<collision name=\"body\"><origin xyz=\"0 0 0.030\"/>",
       "<cylinder radius=\"0.025\" length=\"0.060\"/>", "<box size=\"1 1 1\"/>",
       "link peg: collision", "exactly one cylinder"},
      {"<collision name=\"body\"><origin xyz=\"0 0 0.030\"/>",
       "<cylinder radius=\"0.025\" length=\"0.060\"/>", "<sphere radius=\"1\"/>",
       "link peg: collision body: geometry", "box or a cylinder"},
      // hole
      {hole, "name=\"bore\"", "name=\"bor\"", "link hole: visual bore: value missing", "cylinder"},
      {hole, "name=\"block_0\"", "name=\"bore\"", "link hole: visual bore: value several",
       "keep one"},
      {hole, "<cylinder radius=\"0.0251\" length=\"0.06\"/>", "<box size=\"1 1 1\"/>",
       "link hole: visual bore: value a box", "cylinder"},
      {hole, "length=\"0.06\"", "length=\"0.05\"", "link hole: visual bore: origin z: value -0.03",
       "-0.025"},
      {hole, "radius=\"0.0251\"", "radius=\"0.0252\"", "link hole: collision at",
       "reaches into the bore of radius 0.0252"},
      {hole, "<mass value=\"0.7100\"/>", "<mass value=\"-1\"/>",
       "link hole: inertial: mass: value -1", "> 0"},
      // carrier
      {carrier, "izz=\"1.0e-3\"", "izz=\"0\"", "link carrier: inertia izz: value 0", "> 0"},
  };
  for (const auto& c : cases) {
    const std::string text = changed(c.after, c.from, c.to);
    const std::string error = errorOf([&] { loadCellDescription(text); });
    EXPECT_EQ(error.rfind("robot_description: ", 0), 0u) << c.to << " -> " << error;
    EXPECT_NE(error.find(c.item), std::string::npos) << c.to << " -> " << error;
    EXPECT_NE(error.find(c.says), std::string::npos) << c.to << " -> " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
}

TEST(CellDescription, RefusesALinkWithoutWhatItNeeds) {
  const auto without = [](const std::string& from, const std::string& until) {
    std::string text = defaultUrdf();
    const std::size_t at = text.find(from);
    const std::size_t end = text.find(until, at);
    EXPECT_NE(end, std::string::npos) << from;
    text.erase(at, end + until.size() - at);
    return errorOf([&] { loadCellDescription(text); });
  };
  EXPECT_EQ(without("<inertial><origin xyz=\"0 0 0.030\"/>", "</inertial>"),
            "robot_description: link peg: inertial: value missing: add mass and inertia");
  EXPECT_EQ(without("<collision name=\"body\"><origin xyz=\"0 0 0.030\"/>", "</collision>"),
            "robot_description: link peg: collision: value missing: add a box or cylinder");
  EXPECT_EQ(errorOf([] { loadCellDescription("<robot name=\"a\"><link name=\"b\"/></robot>"); }),
            "robot_description: link world: value missing: add this link");
}

TEST(CellDescription, RefusesAScenarioThatContradictsIt) {
  const CellDescription cell = loadCellDescription(defaultUrdf());
  const std::string path = kSource + "/config/scenarios/cell.yaml";
  const std::pair<const char*, const char*> cases[] = {
      {"peg.radius", "0.0251"},        {"peg.half_height", "0.031"},
      {"peg.mass", "0.396"},           {"peg.inertia_transverse", "2.6e-4"},
      {"peg.inertia_axial", "1.1e-4"}, {"peg.coupling_height", "0.051"},
      {"peg.exciter_height", "0.057"}, {"hole.radius", "0.025100001"},
      {"hole.depth", "0.05"},          {"carrier.mass", "0.4"},
      {"carrier.inertia", "0.081"}};
  for (const auto& [key, value] : cases) {
    const std::string setting = std::string(key) + "=" + value;
    const Scenario scenario = loadScenario(path, {setting});
    const std::string error =
        errorOf([&] { checkAgainst(cell, scenario.mechanism, scenario.name); });
    EXPECT_EQ(error.rfind("scenario cell: " + std::string(key) + ": value ", 0), 0u) << error;
    EXPECT_NE(error.find("the URDF has "), std::string::npos) << error;
  }
  // differences of rounding are none
  EXPECT_NO_THROW(
      checkAgainst(cell, loadMechanism(path, {"peg.radius=0.0250000000000001"}), "cell"));
}

// The only parts that can meet are the peg and the hole block: the others need no search.
TEST(PartPairs, OnlyPegAndHoleMeetInTheDefaultCell) {
  const CellDescription cell = loadCellDescription(defaultUrdf());
  EXPECT_EQ(canMeet(cell, CarrierTravel()), (std::vector<PartPair>{{"peg", "hole"}}));
}

TEST(PartPairs, NothingMeetsAboveThePlane) {
  const CellDescription cell = loadCellDescription(defaultUrdf());
  CarrierTravel travel;
  travel.lowest = 0.015;
  EXPECT_TRUE(canMeet(cell, travel).empty());
}

TEST(PartPairs, DisplacedPartsMeet) {
  const auto meets = [](const CellDescription& cell, const CarrierTravel& travel,
                        const PartPair& pair) {
    const std::vector<PartPair> pairs = canMeet(cell, travel);
    return std::find(pairs.begin(), pairs.end(), pair) != pairs.end();
  };
  const CellDescription cell = loadCellDescription(defaultUrdf());

  // a peg that goes through the whole bore reaches the ground sensor
  CarrierTravel deep;
  deep.lowest = -0.065;
  EXPECT_TRUE(meets(cell, deep, {"peg", "sensor_a"}));
  EXPECT_FALSE(meets(cell, CarrierTravel(), {"peg", "sensor_a"}));

  // a carrier plate moved down by its height over the hole reaches the block
  CellDescription low = cell;
  for (PartShape& shape : low.moving_parts[0].shapes) shape.X_PS.p.z() -= 0.08;
  EXPECT_TRUE(meets(low, CarrierTravel(), {"carrier", "hole"}));
  EXPECT_FALSE(meets(low, CarrierTravel(), {"sensor_b", "hole"}));

  // a block moved aside is out of reach, unless the carrier may go there
  CellDescription aside = cell;
  for (PartShape& shape : aside.fixed_parts[1].shapes) shape.X_PS.p.x() += 0.2;
  EXPECT_TRUE(canMeet(aside, CarrierTravel()).empty());
  CarrierTravel wide;
  wide.lateral = 0.2;
  EXPECT_TRUE(meets(aside, wide, {"peg", "hole"}));
}

TEST(PartPairs, RefusesAnEmptyTravel) {
  const CellDescription cell = loadCellDescription(defaultUrdf());
  CarrierTravel travel;
  travel.highest = -1.0;
  EXPECT_THROW(canMeet(cell, travel), InputError);
  travel.highest = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(canMeet(cell, travel), InputError);
}

// Axis-aligned boxes and cylinders, a tenth of a millimetre on either side of touching.
TEST(PartPairs, ShapesMeetWhereTheyTouch) {
  const PartShape box{PartShape::Kind::kBox, {0.02, 0.04, 0.06}, Pose()};
  PartShape cylinder{PartShape::Kind::kCylinder, {0.05, 0.05, 0.06}, Pose()};
  const auto meet = [&](double x, double y, double z) {
    cylinder.X_PS.p = Eigen::Vector3d(x, y, z);
    return shapesMeet(box, cylinder);
  };
  EXPECT_TRUE(meet(0.0349, 0, 0));
  EXPECT_FALSE(meet(0.0351, 0, 0));
  EXPECT_TRUE(meet(0, 0.0449, 0));
  EXPECT_FALSE(meet(0, 0.0451, 0));
  EXPECT_TRUE(meet(0, 0, 0.0599));
  EXPECT_FALSE(meet(0, 0, 0.0601));
}

}  // namespace
}  // namespace assembly_cell
