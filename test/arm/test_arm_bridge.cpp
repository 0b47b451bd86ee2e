// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "assembly_cell/arm/arm_bridge.h"
#include "assembly_cell/arm/block_barrier.h"
#include "assembly_cell/arm/block_poses.h"

namespace assembly_cell {
namespace {

constexpr StampNs kSecond = 1000000000;
constexpr StampNs kEpoch = 1000 * kSecond;

Pose shifted(double x, double y, double z) { return {Eigen::Matrix3d::Identity(), {x, y, z}}; }

ArmBridge bridgeWith(const Payload& payload, bool lockstep = true) {
  return {armGuard({}, Braking(), LeaseMode::kAuto, lockstep), CellPlace(), payload,
          NodeTime(lockstep, 1.0), 7};
}

void addBlock(ArmBridge& bridge, std::size_t sensor, StampNs end, double fz = 0.0) {
  const std::vector<double> values{0.0, 0.0, fz, 0.0, 0.0, 0.0};
  if (bridge.start(sensor, end) == ArmBridge::Start::kWaiting) return;
  bridge.addBlock({sensor, values.data(), 1, 0.02, end, nullptr});
}

TEST(ArmBridge, ByTheWallClockTimeStartsWithBothSensors) {
  ArmBridge bridge = bridgeWith({}, false);
  EXPECT_EQ(bridge.start(1, kEpoch), ArmBridge::Start::kWaiting);
  EXPECT_FALSE(bridge.time().started());
  EXPECT_EQ(bridge.start(0, kEpoch), ArmBridge::Start::kContinues);
  EXPECT_TRUE(bridge.time().started());
  EXPECT_NEAR(bridge.time().at(kEpoch + kSecond / 2), 0.5, 1e-12);
  EXPECT_EQ(bridge.time().stampAt(0.5), kEpoch + kSecond / 2);
}

TEST(ArmBridge, ASensorThatTheCellDoesNotHaveIsNotAwaited) {
  ArmLimits limits;
  limits.sensors = Sensors::kB;
  ArmBridge bridge(armGuard(limits, Braking(), LeaseMode::kAuto, false), CellPlace(), {},
                   NodeTime(false, 1.0), 7);
  EXPECT_EQ(bridge.missing(), "no samples of sensor_b");
  addBlock(bridge, 1, kEpoch);
  EXPECT_TRUE(bridge.time().started());
  EXPECT_TRUE(bridge.setState(Pose(), kEpoch, ""));
  EXPECT_EQ(bridge.missing(), "");
}

TEST(BlockBarrier, WithOneSensorItsSamplesCompleteABlock) {
  BlockBarrier barrier(Sensors::kB);
  EXPECT_FALSE(barrier.complete());
  EXPECT_TRUE(barrier.add(1, 3));
  ASSERT_EQ(barrier.complete(), 3U);
  EXPECT_TRUE(barrier.finish().empty());
  EXPECT_FALSE(barrier.complete());
}

TEST(ArmBridge, ARestartDropsStateAndKeepsAStop) {
  ArmBridge bridge = bridgeWith({});
  addBlock(bridge, 1, kEpoch);
  EXPECT_TRUE(bridge.setState(Pose(), kEpoch, ""));
  addBlock(bridge, 1, kEpoch + kSecond);
  stopForGood(bridge.guard(), "the service stop was called");
  const std::string reason = bridge.guard().text;
  EXPECT_EQ(bridge.start(1, kEpoch), ArmBridge::Start::kRestarted);
  EXPECT_EQ(bridge.bootId(), 8U);
  EXPECT_FALSE(bridge.guard().state_known);
  EXPECT_FALSE(bridge.poses().pending());
  EXPECT_EQ(bridge.guard().mode, ArmMode::kStopped);
  EXPECT_EQ(bridge.guard().text, reason);
}

TEST(ArmBridge, CommandsWithoutAStampOrFromBeforeTheStartAreRefused) {
  ArmBridge bridge = bridgeWith({});
  EXPECT_EQ(bridge.move("/a", kEpoch, shifted(0.01, 0, 0)).reason, GuardReason::kEarlierBoot);
  addBlock(bridge, 1, kEpoch);
  EXPECT_EQ(bridge.move("/a", kEpoch, shifted(0.01, 0, 0)).reason, GuardReason::kEarlierBoot);
  bridge.setState(Pose(), kEpoch, "");
  EXPECT_EQ(bridge.move("/a", 0, shifted(0.01, 0, 0)).reason, GuardReason::kStale);
  EXPECT_EQ(bridge.move("/a", kEpoch - kSecond, shifted(0.01, 0, 0)).reason,
            GuardReason::kEarlierBoot);
  EXPECT_TRUE(bridge.move("/a", kEpoch, shifted(0.01, 0, 0)).good());
  EXPECT_EQ(bridge.drive("/a", 0, {1.0, 100.0, 0.0, 1}).reason, GuardReason::kStale);
  EXPECT_TRUE(bridge.drive("/a", 0, {0.0, 0.0, 0.0, 1}).good());
}

// 2 kg whose centre is 0.1 m along x, turned by 90 degrees about x since the zero.
TEST(ArmBridge, TheWeightThatARotationShiftsIsRemoved) {
  const Payload payload{{0.0, 0.0, -20.0}, {0.1, 0.0, 0.0}};
  const Eigen::Matrix3d R = rotationFromVector({Eigen::Vector3d(M_PI / 2.0, 0.0, 0.0)});
  const Vector6 change = weightChange(payload, Eigen::Matrix3d::Identity(), R);
  Vector6 expected;
  expected << 0.0, -20.0, 20.0, 0.0, -2.0, -2.0;
  EXPECT_LT((change - expected).norm(), 1e-12);

  ArmBridge bridge = bridgeWith(payload);
  addBlock(bridge, 1, kEpoch);
  bridge.setState(Pose(), kEpoch, "");
  bridge.setZero(1, Vector6::Zero());
  bridge.setState({R, Eigen::Vector3d::Zero()}, kEpoch, "");
  addBlock(bridge, 1, kEpoch, 21.0);
  EXPECT_NEAR(bridge.guard().wrench[1](2), 1.0, 1e-12);
  EXPECT_NEAR(bridge.guard().wrench[1](1), 20.0, 1e-12);
}

TEST(BlockPoses, AreInterpolatedBetweenStates) {
  BlockPoses poses;
  poses.addBlock(1.0);
  EXPECT_FALSE(poses.next());
  poses.addState(0.9, coordinatesOf(shifted(0.01, 0, 0)));
  EXPECT_FALSE(poses.next());
  EXPECT_TRUE(poses.pending());
  poses.addState(1.1, coordinatesOf(shifted(0.03, 0, 0)));
  const auto pose = poses.next();
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->end, 1.0);
  EXPECT_NEAR(pose->X.p.x(), 0.02, 1e-12);
  EXPECT_FALSE(poses.pending());
}

TEST(BlockBarrier, CommandsWaitForTheSamplesOfBothSensors) {
  BlockBarrier barrier;
  std::string order;
  EXPECT_TRUE(barrier.add(0, 3));
  EXPECT_FALSE(barrier.add(0, 3));
  barrier.defer([&] { order += "command"; });
  barrier.deferFirst([&] { order += "lease "; });
  EXPECT_FALSE(barrier.complete());
  EXPECT_FALSE(barrier.isStuck());
  EXPECT_TRUE(barrier.add(1, 3));
  EXPECT_TRUE(barrier.isStuck());
  ASSERT_EQ(barrier.complete(), 3U);
  for (const auto& task : barrier.finish()) task();
  EXPECT_EQ(order, "lease command");
  EXPECT_TRUE(barrier.isFinished(3));
  EXPECT_FALSE(barrier.complete());
  EXPECT_TRUE(barrier.finish().empty());
  // sensor_b's samples come again after a restart
  barrier.restart();
  EXPECT_TRUE(barrier.add(1, 3));
  EXPECT_EQ(barrier.complete(), 3U);
}

TEST(ArmBridge, ByTheWallClockAnArmAheadOfItDoesNotStart) {
  for (const StampNs error : {kSecond / 2, -kSecond / 2}) {
    ArmBridge bridge = bridgeWith({}, false);
    EXPECT_EQ(bridge.missing(), "no samples of sensor_a and sensor_b");
    for (int i = 0; i < 2; ++i) {
      addBlock(bridge, 1, kEpoch);
      if (i == 0) EXPECT_EQ(bridge.missing(), "no samples of sensor_a");
      addBlock(bridge, 0, kEpoch);
    }
    EXPECT_FALSE(bridge.setState(Pose(), kEpoch + error, ""));
    EXPECT_NE(bridge.missing().find("the arm's stamps are 0."), std::string::npos)
        << bridge.missing();
    // no pose of another time
    EXPECT_FALSE(bridge.poses().next());
    EXPECT_TRUE(bridge.setState(Pose(), kEpoch, ""));
  }
}

TEST(BlockPoses, AClockThatIsSetBackDropsTheStatesBefore) {
  BlockPoses poses;
  const auto x = [](double value) { return Vector6(value * Vector6::UnitX()); };
  poses.addState(100.0, x(1.0));
  poses.addState(10.0, x(2.0));
  poses.addBlock(10.1);
  EXPECT_FALSE(poses.next());
  poses.addState(10.2, x(4.0));
  const auto pose = poses.next();
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->X.p.x(), 3.0, 1e-9);
}

}  // namespace
}  // namespace assembly_cell
