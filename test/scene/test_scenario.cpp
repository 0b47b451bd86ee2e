// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/scene/scenario_numbers.h"
#include "scenario_text.h"

namespace assembly_cell {
namespace {

std::string configPath(const std::string& name) {
  return (std::filesystem::path(ASSEMBLY_CELL_SOURCE_DIR) / "config" / "scenarios" / name).string();
}

TEST(Scenario, EveryKeyArrivesInItsField) {
  const Scenario s = with(
      {"coupling.axes=carrier", "hole.depth=0.05", "hole.chamfer={width: 4e-4, angle: 0.5}",
       "carrier.max_speed=0.07", "carrier.max_acceleration=2",
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
  EXPECT_EQ(s.mechanism.hole.chamfer_width, 4e-4);
  EXPECT_EQ(s.mechanism.hole.chamfer_angle, 0.5);
  EXPECT_EQ(s.mechanism.carrier.mass, 0.395);
  EXPECT_EQ(s.mechanism.carrier.inertia, 0.081);
  EXPECT_EQ(s.mechanism.carrier.stiffness, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(s.mechanism.carrier.damping, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(s.mechanism.carrier.max_speed, 0.07);
  EXPECT_EQ(s.mechanism.carrier.max_acceleration, 2.0);
  EXPECT_EQ(s.mechanism.coupling.stiffness.diagonal,
            (Vector6() << 10, 20, 30, 40, 50, 60).finished());
  EXPECT_EQ(s.mechanism.coupling.axes, CouplingAxes::kCarrier);
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
  EXPECT_FALSE(s.contact.features & kEdgeEdgeSlots);
  EXPECT_TRUE(s.contact.features & kEdgePlaneSlots);
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
  EXPECT_TRUE(s.contact.features & kEdgeEdgeSlots);
  EXPECT_TRUE(s.contact.features & kEdgePlaneSlots);
  EXPECT_EQ(s.contact.regularisation_speed, defaults.contact.regularisation_speed);
  EXPECT_EQ(s.mechanism.carrier.max_speed, defaults.mechanism.carrier.max_speed);
  EXPECT_EQ(s.solver.integrator, defaults.solver.integrator);
  EXPECT_EQ(s.solver.tolerance, defaults.solver.tolerance);
}

// Stress-free: the coupling point of the peg lies at the carrier's rest point, angles agree.
TEST(Scenario, AbsentInitialStartsAtRestStressFree) {
  const Scenario s = with({});
  // the axis by its angles (docs/reference/conventions.md) in axes x, y, z
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

// A mount's compliance, every entry its own: its inverse is the stiffness, in the order of a
// wrench, and what a program writes is read again with the same entries.
TEST(Scenario, AComplianceIsTheInverseOfTheStiffness) {
  Matrix6 L = Matrix6::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) L(i, j) = i == j ? 1.0 : 0.05 * (i + 1) - 0.04 * j;
  }
  Vector6 size;
  size << 2e-3, 3e-3, 1e-3, 5e-2, 4e-2, 6e-2;
  const Matrix6 C = size.asDiagonal() * (L * L.transpose()) * size.asDiagonal();
  std::string rows;
  for (int i = 0; i < 36; ++i) rows += (i == 0 ? "[" : ", ") + yamlNumber(C(i / 6, i % 6));
  std::string text = kBase;
  const std::size_t at = text.find("  stiffness: {diagonal: [10");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, text.find('\n', at) - at, "  compliance: " + rows + "]");
  const Scenario s = parseScenario(text, "file.yaml");
  const Matrix6 one = couplingStiffness(s.mechanism.coupling) * C;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) EXPECT_NEAR(one(i, j) * size(i) / size(j), i == j, 1e-12);
  }
  const Mechanism again = parseMechanism(mechanismText(s.mechanism), "again");
  EXPECT_EQ(couplingStiffness(again.coupling), couplingStiffness(s.mechanism.coupling));
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

// ISO 286-2: of 50 mm, H7 is 0 to 25 um and g6 -25 to -9 um; of 20 mm 0 to 21 and -20 to -7 um.
TEST(Scenario, AFitIsTheTolerancesOfBothRadii) {
  const auto expect = [](const RadiusTolerance& found, double low, double high) {
    EXPECT_NEAR(found[0], low, 1e-9);
    EXPECT_NEAR(found[1], high, 1e-9);
  };
  // radii that are the nominal one become the middle of their zones
  const Mechanism nominal = with({"hole={radius: 0.025, fit: H7/g6}"}).mechanism;
  EXPECT_NEAR(nominal.hole.radius, 0.02500625, 1e-12);
  EXPECT_NEAR(nominal.peg.radius, 0.0249915, 1e-12);
  expect(nominal.hole.radius_tolerance, 0.025, 0.0250125);
  expect(nominal.peg.radius_tolerance, 0.0249875, 0.0249955);
  // others are those of the parts, as make_peg writes them
  const Mechanism middle =
      with({"hole={radius: 0.01000525, fit: H7/g6}", "peg.radius=0.00999325"}).mechanism;
  EXPECT_EQ(middle.hole.radius, 0.01000525);
  EXPECT_EQ(middle.peg.radius, 0.00999325);
  expect(middle.hole.radius_tolerance, 0.01, 0.0100105);
  expect(middle.peg.radius_tolerance, 0.00999, 0.0099965);
  // a mechanism file that is written has the tolerances
  const Mechanism again = parseMechanism(mechanismText(middle), "written");
  EXPECT_EQ(again.hole.radius_tolerance, middle.hole.radius_tolerance);
  EXPECT_EQ(again.peg.radius_tolerance, middle.peg.radius_tolerance);
  EXPECT_EQ(with({}).mechanism.hole.radius_tolerance, kNoTolerance);
  const Mechanism given = with({"hole.radius_tolerance=[0.0250, 0.0252]"}).mechanism;
  expect(given.hole.radius_tolerance, 0.025, 0.0252);
  // a study reads the file again for each radius then
  Scenario free = with({}), fitted = with({"hole={radius: 0.025, fit: H7/g6}"});
  bool independent = false;
  ASSERT_NE(scenarioNumber(free, "hole.radius", &independent), nullptr);
  EXPECT_TRUE(independent);
  ASSERT_NE(scenarioNumber(fitted, "hole.radius", &independent), nullptr);
  EXPECT_FALSE(independent);
}

TEST(Scenario, GravityIsANumberOrAVector) {
  const std::string path = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml";
  EXPECT_EQ(loadScenario(path).mechanism.up, Eigen::Vector3d::UnitZ());
  const Mechanism m = loadMechanism(path, {"gravity=[0, -9.8, 0]"});
  EXPECT_EQ(m.gravity, 9.8);
  EXPECT_EQ(m.up, Eigen::Vector3d::UnitY());
  // written so that it is read again
  const Mechanism again = parseMechanism(mechanismText(m), "written");
  EXPECT_EQ(again.gravity, m.gravity);
  EXPECT_EQ(again.up, m.up);
  const Mechanism down = loadMechanism(path, {"gravity=[0, 0, -9.8]"});
  EXPECT_EQ(down.gravity, 9.8);
  EXPECT_EQ(down.up, Eigen::Vector3d::UnitZ());
  for (const char* wrong : {"gravity=[0, -9.8]", "gravity=[0, .nan, 0]", "gravity=-9.8"}) {
    EXPECT_THROW(loadMechanism(path, {wrong}), InputError) << wrong;
  }
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
  for (const auto& entry : std::filesystem::recursive_directory_iterator(configPath(""))) {
    if (!entry.is_regular_file()) continue;
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
