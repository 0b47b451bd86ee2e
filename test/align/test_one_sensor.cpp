// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A cell with sensor_b alone.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/estimation/block_pipeline.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

CellParameters wristOnly() {
  CellParameters parameters;
  parameters.sensors = Sensors::kB;
  parameters.seed = 7;
  return parameters;
}

TEST(OneSensor, AutoAlignsAndReadsNothingOfTheOther) {
  const Scenario scenario = cell();
  AlignParameters parameters;
  const AlignTrial trial = tryAlignment(scenario, scenario.mechanism, wristOnly(), parameters, {});
  EXPECT_TRUE(trial.success) << trial.result.reason;
  SimulatedPlant plant(scenario, scenario.mechanism, wristOnly());
  const PlantBlock block = plant.next({});
  EXPECT_TRUE(block.wrench_a.isZero(0.0));
  EXPECT_GT(block.wrench_b.norm(), 0.1);
  EXPECT_EQ(block.samples, 100);
  EXPECT_EQ(plant.twinForce(), nullptr);
}

TEST(OneSensor, SensorBMeasuresWhatItDoesBesideAnother) {
  const Scenario scenario = cell();
  CellParameters both = wristOnly();
  both.sensors = Sensors::kBoth;
  SimulatedPlant one(scenario, scenario.mechanism, wristOnly());
  SimulatedPlant two(scenario, scenario.mechanism, both);
  for (int i = 0; i < 5; ++i) {
    const PlantBlock a = one.next({}), b = two.next({});
    EXPECT_TRUE((a.wrench_b.array() == b.wrench_b.array()).all());
    EXPECT_TRUE((a.displacement_b.array() == b.displacement_b.array()).all());
  }
}

TEST(OneSensor, TwinForceIsRefusedByName) {
  const Scenario scenario = cell();
  AlignParameters parameters;
  parameters.strategy = "twin_force";
  SimulatedPlant plant(scenario, scenario.mechanism, wristOnly());
  try {
    align(plant, scenario.mechanism, parameters, {});
    ADD_FAILURE() << "accepted";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("strategy: twin_force: ", 0), 0U) << error.what();
    EXPECT_NE(std::string(error.what()).find("sensor_b alone"), std::string::npos);
  }
}

// The line that refuses a mount at an arm with this delay; empty: it is accepted.
std::string refusalOf(double compliance, double delay) {
  Mechanism mechanism = cell().mechanism;
  mechanism.coupling.stiffness.diagonal.head<3>().setConstant(1.0 / compliance);
  AlignParameters parameters;
  parameters.arm_delay = delay;
  try {
    checkGoal(mechanism, parameters);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

double numberAfter(const std::string& text, const std::string& words) {
  return std::stod(text.substr(text.find(words) + words.size()));
}

TEST(Mount, OneThatIsTooStiffForTheArmIsRefusedWithWhatWouldDo) {
  EXPECT_EQ(refusalOf(1e-6, 0.0), "") << "no arm";
  EXPECT_EQ(refusalOf(8e-6, 0.05), "");
  EXPECT_EQ(refusalOf(2e-5, 0.1), "");
  const std::string stiff = refusalOf(2e-6, 0.02);
  EXPECT_NE(stiff.find("yields 2 um/N"), std::string::npos) << stiff;
  const double enough = numberAfter(stiff, "; give it ");
  EXPECT_EQ(refusalOf(1.001e-6 * enough, 0.02), "");
  EXPECT_NE(refusalOf(0.9e-6 * enough, 0.02), "");
}

// F = F_t + (v T + v²/(2 a)) / C with the scaled touch of 1.5 N, 1 m/s² and what the mount yields
// at the edge. 5 mm/s are slowed down to a third for an arm that is 12 steps late, and where the
// mount is five times as stiff to what reaches 45 % of the force limit of 40 N.
TEST(Mount, AnArmThatIsLateMovesAsSlowlyAsTheMountNeeds) {
  EXPECT_EQ(refusalOf(2e-5, 0.05), "");
  EXPECT_EQ(refusalOf(2e-5, 0.25), "");
  EXPECT_EQ(refusalOf(5e-6, 0.25), "");
  Mechanism mechanism = cell().mechanism;
  AlignParameters parameters;
  parameters.arm_delay = 0.25;
  const auto force = [&](double v) {
    return 1.5 * scaleOf(mechanism).force + (v * 0.25 + v * v / 2.0) / pressCompliance(mechanism);
  };
  const ArmTouch soft = armTouch(mechanism, parameters);
  EXPECT_EQ(soft.slower, 1.0);
  EXPECT_DOUBLE_EQ(soft.speed, 5e-3 * scaleOf(mechanism).step / 3.0);
  EXPECT_NEAR(soft.force, force(soft.speed), 1e-9);
  mechanism.coupling.stiffness.diagonal *= 5.0;
  mechanism.coupling.stiffness.k26 *= 5.0;
  mechanism.coupling.stiffness.k35 *= 5.0;
  const ArmTouch stiff = armTouch(mechanism, parameters);
  EXPECT_LT(stiff.slower, 1.0);
  EXPECT_NEAR(stiff.force, 18.0, 1e-9);
  EXPECT_NEAR(stiff.force, force(stiff.speed), 1e-9);
  mechanism.arm = {0.25, 0.0, 1.0 / pressCompliance(cell().mechanism), 0.0};
  EXPECT_EQ(armTouch(mechanism, AlignParameters()).slower, 1.0) << "as identified";
}

TEST(OneSensor, ABlockNeedsSensorBAlone) {
  Calibration identity;
  identity.volts_to_wrench.setIdentity();
  identity.volts_to_displacement = 1e-6 * Matrix6::Identity();
  BlockPipeline one(0.0, Sensors::kB), two(0.0);
  one.setCalibration(1, identity);
  two.setCalibration(1, identity);
  EXPECT_TRUE(one.calibrated());
  EXPECT_FALSE(two.calibrated());
  const std::vector<double> values(12, 3.0), bad(12, std::numeric_limits<double>::quiet_NaN());
  const SensorSamples good{values.data(), nullptr, 2};
  const auto block = one.fromWrenches({}, good, good, 1e-3);
  ASSERT_TRUE(block.has_value());
  EXPECT_EQ(block->samples, 2);
  EXPECT_EQ(block->wrench_b(0), 3.0);
  EXPECT_FALSE(one.fromWrenches({}, {bad.data(), nullptr, 2}, good, 1e-3).has_value());
  EXPECT_FALSE(two.fromWrenches({}, good, good, 1e-3).has_value());
}

}  // namespace
}  // namespace assembly_cell
