// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A strategy's plant with an arm that carries the carrier, and the bridge before it.
#include "assembly_cell/cell/carrier_arm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/start.h"
#include "scenarios.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

const std::string kSource = ASSEMBLY_CELL_SOURCE_DIR;

ArmSetup setup() { return loadArmSetup(kSource + "/config/arm/emulated.yaml"); }

CellParameters with(const ArmSetup& arm, std::uint64_t seed = 1) {
  CellParameters cell;
  cell.seed = seed;
  cell.arm = std::make_shared<ArmSetup>(arm);
  return cell;
}

PlantCommand to(double x, double y, double z) {
  PlantCommand command;
  command.rest.emplace();
  command.rest->x = x;
  command.rest->y = y;
  command.rest->z = z;
  return command;
}

PlantBlock wait(Plant& plant, int blocks) {
  PlantBlock block;
  for (int i = 0; i < blocks; ++i) block = plant.next({});
  return block;
}

// where the carrier really is, in its base
Eigen::Vector3d truth(SimulatedPlant& plant, const Scenario& scenario) {
  return (inverse(carrierBase(scenario)) * plant.truth().carrierPose()).p;
}

TEST(CarrierArm, GoesWhereItIsSentLateAndNotQuiteExactly) {
  const Scenario scenario = cell();
  ArmSetup arm = setup();
  SimulatedPlant plant(scenario, scenario.mechanism, with(arm));
  const PlantBlock before = plant.next({});
  EXPECT_LT(std::abs(before.carrier.z), 2e-6);
  // down by 2 mm at most at 50 mm/s: not there after a block, and the arm's encoders say so
  const PlantBlock first = plant.next(to(0.0, 0.0, 0.002));
  EXPECT_LT(first.carrier.z, 1e-3);
  const PlantBlock there = wait(plant, 30);
  EXPECT_NEAR(there.carrier.z, 0.002, 2e-6);
  EXPECT_NEAR(there.carrier.x, 0.0, 2e-6);
  // it stands somewhere else by its repeatability, which the encoders don't see
  const double off = (truth(plant, scenario) - Eigen::Vector3d(0.0, 0.0, 0.002)).norm();
  EXPECT_GT(off, 2e-6);
  EXPECT_LT(off, 2e-4);
  // an arm with exact repeatability and no compliance is where its encoders report it
  arm.arm.arm.repeatability = 0.0;
  arm.arm.arm.compliance.setZero();
  SimulatedPlant exact(scenario, scenario.mechanism, with(arm));
  exact.next(to(0.0, 0.0, 0.002));
  wait(exact, 30);
  EXPECT_LT((truth(exact, scenario) - Eigen::Vector3d(0.0, 0.0, 0.002)).norm(), 3e-6);
}

TEST(CarrierArm, RefusesAndHoldsByName) {
  const Scenario scenario = cell();
  const auto reason = [&](const ArmSetup& arm, const PlantCommand& command) -> std::string {
    SimulatedPlant plant(scenario, scenario.mechanism, with(arm));
    try {
      plant.next(command);
      wait(plant, 200);
    } catch (const PlantError& error) {
      return error.what();
    }
    return "";
  };
  const ArmSetup arm = setup();
  EXPECT_EQ(reason(arm, to(0.0, 0.0, 0.002)), "");
  EXPECT_NE(reason(arm, to(0.11, 0.0, 0.0)).find("refused: workspace"), std::string::npos);
  // down onto the plane: held before the limit, whatever was commanded
  ArmSetup soft = arm;
  soft.bridge.limits.guard.force = 20.0;
  const std::string held = reason(soft, to(0.0, 0.0, -0.02));
  EXPECT_NE(held.find("the plant stopped itself: max_force"), std::string::npos) << held;
  // a joint that can't
  ArmSetup stiff = arm;
  const std::size_t limit = stiff.urdf.find("velocity=\"");
  ASSERT_NE(limit, std::string::npos);
  const std::size_t begin = limit + 10;
  stiff.urdf.replace(begin, stiff.urdf.find('"', begin) - begin, "1e-4");
  const std::string joint = reason(stiff, to(0.0, 0.03, 0.0));
  EXPECT_NE(joint.find("unreachable: joint"), std::string::npos) << joint;
}

TEST(CarrierArm, BadFilesAreRefusedByName) {
  const auto refusal = [](const std::string& text) -> std::string {
    const std::string path = test::temporaryFile("carrier_arm.yaml");
    std::ofstream(path) << text;
    try {
      loadArmSetup(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const std::string arm = kSource + "/config/arm/", urdf = "urdf: " + kSource + "/urdf/arm.urdf\n";
  const std::string start = "format: 1\n" + urdf + "place: " + arm + "cell_place.yaml\n";
  const std::string bridge = "bridge: " + arm + "arm_bridge.yaml\n";
  EXPECT_EQ(refusal(start + bridge + "arm: " + arm + "emulate_arm.yaml\n"), "");
  EXPECT_NE(refusal(start + bridge).find("arm"), std::string::npos);
  EXPECT_NE(refusal(start + bridge + "arm: nowhere.yaml\n").find("nowhere.yaml"),
            std::string::npos);
  EXPECT_NE(refusal(start + "bridge: " + arm + "emulate_arm.yaml\narm: x.yaml\n")
                .find("looks like parameters of emulate_arm"),
            std::string::npos);
  // and what is read but can't be
  ArmSetup wrong = setup();
  wrong.bridge.workspace[0] = 0.2;
  const Scenario scenario = cell();
  EXPECT_THROW(SimulatedPlant(scenario, scenario.mechanism, with(wrong)), InputError);
  wrong = setup();
  wrong.place.carrier_height = 5.0;
  EXPECT_THROW(SimulatedPlant(scenario, scenario.mechanism, with(wrong)), InputError);
}

TEST(CarrierArm, AlignsAndInsertsTheSameEachTime) {
  const Scenario start = startAt(cell(), {0.004, -0.003}, {0.01, -0.012}, 0.003);
  AlignParameters parameters;
  parameters.strategy = "touch";
  parameters.insert.depth = 0.01;
  const auto run = [&] {
    return tryAlignment(start, start.mechanism, with(setup(), 7), parameters);
  };
  const AlignTrial one = run(), two = run();
  EXPECT_TRUE(one.success) << one.result.reason;
  EXPECT_GT(one.depth, 0.0098);
  EXPECT_EQ(one.X_HP.p, two.X_HP.p);
  EXPECT_EQ(one.result.time, two.result.time);
}

// Two starts from `align --seed 60000`: a swing of the peg after the arm's move was taken for a
// wall four millimetres away; a knock of one sample held the arm.
TEST(CarrierArm, NeitherASwingNorAKnockEndsARun) {
  struct Case {
    std::uint64_t seed;
    Eigen::Vector2d offset, tilt;
  };
  for (const Case& c : {Case{60012,
                             {-0.01002215102617899, 0.006635518872524145},
                             {0.005360752365043111, -0.002135926753750186}},
                        Case{60038,
                             {-0.0008127133448993699, -0.008779502040899232},
                             {-0.032088224871964645, -0.0030986762477974647}}}) {
    const Scenario start = startAt(cell(), c.offset, c.tilt, 0.003);
    const AlignTrial trial =
        tryAlignment(start, start.mechanism, with(setup(), c.seed), AlignParameters());
    EXPECT_TRUE(trial.success) << c.seed << ": " << trial.result.reason;
  }
}

// An arm of 100 and one of 250 ms: the delay shows in the first descent. Before it was measured,
// commands that had no effect yet counted as carried out, and the first touch pressed with 32 and
// 65 N.
TEST(CarrierArm, AlignsAndInsertsWithAnArmThatAnswersLate) {
  struct Case {
    double latency, time;
  };
  for (const Case& c : {Case{0.1, 60.0}, Case{0.25, 110.0}}) {
    ArmSetup late = setup();
    late.arm.arm.latency = c.latency;
    late.bridge.limits.following_time = c.latency + 0.15;
    AlignParameters parameters;
    parameters.insert.depth = 0.04;
    for (int seed = 1; seed <= 3; ++seed) {
      const Scenario start = startAt(cell(), {0.004 * seed, -0.003}, {0.01, -0.008 * seed}, 0.003);
      const AlignTrial trial = tryAlignment(
          start, start.mechanism, with(late, static_cast<std::uint64_t>(seed)), parameters);
      EXPECT_TRUE(trial.success) << c.latency << ", " << seed << ": " << trial.result.reason;
      EXPECT_GT(trial.depth, 0.0398);
      EXPECT_LT(trial.result.time, c.time) << c.latency << ", " << seed;
      // twice what an arm of 10 ms presses with at most
      EXPECT_LT(trial.force, 30.0) << c.latency << ", " << seed;
    }
  }
}

// A fit of 10 um. Before a descent waited for its end a peg counted as in the hole that still went
// down, and walls were measured a move late: none was aligned within 360 s.
TEST(CarrierArm, FindsTheMiddleOfACloseFitWithAnArmThatAnswersLate) {
  Scenario close = cell();
  close.mechanism.hole.radius = close.mechanism.peg.radius + 1e-5;
  ArmSetup late = setup();
  late.arm.arm.latency = 0.25;
  late.bridge.limits.following_time = 0.4;
  late.bridge.limits.delay = 0.25;
  AlignParameters parameters;
  parameters.insert.depth = 0.02;
  parameters.arm_delay = 0.25;
  for (int seed = 1; seed <= 2; ++seed) {
    const Scenario start = startAt(close, {0.004 * seed, -0.003}, {0.01, -0.008 * seed}, 0.003);
    const AlignTrial trial = tryAlignment(start, start.mechanism,
                                          with(late, static_cast<std::uint64_t>(seed)), parameters);
    EXPECT_TRUE(trial.success) << seed << ": " << trial.result.reason;
    EXPECT_LT(trial.force, 30.0) << seed;
  }
}

}  // namespace
}  // namespace assembly_cell
