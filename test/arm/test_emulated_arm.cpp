// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "assembly_cell/arm/emulated_arm.h"

namespace assembly_cell {
namespace {

/// The package's arm over the default cell, without errors unless a test sets them.
struct Bench {
  CellPlace place =
      loadCellPlace(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/arm/cell_place.yaml");
  ArmKinematics kinematics{urdf(), "tool0", "arm"};
  JointVector q{6};
  EmulatedArmParameters parameters;
  EmulatedArm arm;

  static std::string urdf() {
    std::ifstream in(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/urdf/arm.urdf");
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  Bench() {
    parameters.jitter = parameters.repeatability = 0.0;
    parameters.compliance.setZero();
    q << -0.2, 0.07, 2.1, -0.6, -1.57, 0.0;
    EXPECT_TRUE(kinematics.solve(place.flangeOf(Pose()), q).reached);
  }
  void start() { arm = emulatedArm(parameters, place, kinematics, q, 0.0); }
  JointVector turned(Eigen::Index joint, double angle) const {
    JointVector out = q;
    out(joint) += angle;
    return out;
  }
};

// Critically damped: 1 − (1 + w t) e^(−w t) of a step, after the latency.
TEST(EmulatedArm, FollowsAStepAfterItsLatency) {
  Bench bench;
  bench.start();
  command(bench.arm, bench.turned(5, 0.01), 0.0);
  advance(bench.arm, bench.kinematics, 0.008);
  EXPECT_EQ(bench.arm.q, bench.q);
  const double w = 2.0 * M_PI * bench.parameters.bandwidth;
  for (const double time : {0.02, 0.03, 0.05, 0.1}) {
    advance(bench.arm, bench.kinematics, time);
    const double t = time - bench.parameters.latency;
    const double expected = 0.01 * (1.0 - (1.0 + w * t) * std::exp(-w * t));
    // steps of half a millisecond, of which w h is 0.08
    EXPECT_NEAR(bench.arm.q(5) - bench.q(5), expected, 0.08 * 0.01) << time;
  }
}

TEST(EmulatedArm, TheThreePosesGiveRateAndAcceleration) {
  Bench bench;
  bench.start();
  command(bench.arm, bench.turned(0, 0.05), 0.0);
  advance(bench.arm, bench.kinematics, 0.02);
  const CarrierPoses now = carrier(bench.arm, bench.kinematics);
  const Eigen::Vector3d rate = (now.after.p - now.before.p) / (2.0 * now.step);
  // about the base's axis: rate of the joint times the lever; the chord is a millionth shorter
  const double lever = (bench.place.carrierBase() * now.at).p.head<2>().norm();
  EXPECT_NEAR(rate.norm(), std::abs(bench.arm.rate(0)) * lever, 1e-5);
  EXPECT_GT(rate.norm(), 0.1);
}

TEST(EmulatedArm, KeepsSpeedAndLimitsOfItsJoints) {
  Bench bench;
  bench.start();
  command(bench.arm, bench.turned(0, 100.0), 0.0);
  double fastest = 0.0;
  for (double t = 0.0; t < 6.0; t += 0.01) {
    advance(bench.arm, bench.kinematics, t);
    fastest = std::max(fastest, std::abs(bench.arm.rate(0)));
  }
  EXPECT_LE(fastest, bench.kinematics.limits().speed(0));
  EXPECT_EQ(bench.arm.q(0), bench.kinematics.limits().upper(0));
}

TEST(EmulatedArm, EncodersAreSteps) {
  Bench bench;
  bench.parameters.encoder_step = 1e-3;
  bench.start();
  const JointVector q = encoders(bench.arm);
  EXPECT_LE((q - bench.arm.q).cwiseAbs().maxCoeff(), 0.5e-3);
  for (const double value : q) EXPECT_NEAR(value / 1e-3, std::round(value / 1e-3), 1e-9);
}

TEST(EmulatedArm, YieldsUnderForceUnseenByItsEncoders) {
  Bench bench;
  bench.parameters.compliance.setConstant(1e-6);
  bench.start();
  const JointVector before = encoders(bench.arm);
  Vector6 push = Vector6::Zero();
  push(2) = 20.0;
  load(bench.arm, push);
  advance(bench.arm, bench.kinematics, 1.0);
  EXPECT_EQ(encoders(bench.arm), before);
  EXPECT_NEAR(carrier(bench.arm, bench.kinematics).at.p.z(), 20e-6, 1e-8);
}

// 100 moves and back: sd of their final positions is that of the parameter (χ² of 300 values within
// 5 sd).
TEST(EmulatedArm, MovesEndWithItsRepeatability) {
  Bench bench;
  bench.parameters.repeatability = 3e-5;
  bench.start();
  double sum = 0.0, time = 0.0;
  for (int i = 0; i < 100; ++i) {
    command(bench.arm, bench.turned(0, i % 2 == 0 ? 0.01 : 0.0), time);
    advance(bench.arm, bench.kinematics, time += 1.0);
    const Pose by_joints = bench.place.carrierOf(bench.kinematics.forward(bench.arm.q));
    sum += (carrier(bench.arm, bench.kinematics).at.p - by_joints.p).squaredNorm();
  }
  EXPECT_NEAR(sum / (3e-5 * 3e-5) / 300.0, 1.0, 5.0 * std::sqrt(2.0 / 300.0));
}

// There and back by 10 mm: the carrier follows by half of the gap less, then the whole gap less
// than its joints, and the poses about a time have the rate of what the joints take along.
TEST(EmulatedArm, BacklashIsLostWhereAMoveReverses) {
  Bench bench;
  bench.parameters.backlash = 1e-4;
  bench.start();
  const auto byJoints = [&] {
    return bench.place.carrierOf(bench.kinematics.forward(bench.arm.q));
  };
  const auto lost = [&]() -> Eigen::Vector3d {
    return carrier(bench.arm, bench.kinematics).at.p - byJoints().p;
  };
  EXPECT_EQ(lost(), Eigen::Vector3d::Zero());
  const Pose start = byJoints();
  JointVector there = bench.q;
  ASSERT_TRUE(bench.kinematics
                  .solve(bench.place.flangeOf(start * Pose{Eigen::Matrix3d::Identity(),
                                                           Eigen::Vector3d(0.01, 0, 0)}),
                         there)
                  .reached);
  command(bench.arm, there, 0.0);
  advance(bench.arm, bench.kinematics, 0.04);
  const CarrierPoses on = carrier(bench.arm, bench.kinematics);
  EXPECT_NEAR(lost().x(), -5e-5, 1e-12);
  EXPECT_GT((on.after.p - on.before.p).x() / (2.0 * on.step), 0.05);
  advance(bench.arm, bench.kinematics, 1.0);
  EXPECT_NEAR(lost().x(), -5e-5, 1e-12);
  command(bench.arm, bench.q, 1.0);
  const double end = carrier(bench.arm, bench.kinematics).at.p.x();
  double time = 1.0;
  while (byJoints().p.x() > start.p.x() + 0.01 - 5e-5) {
    advance(bench.arm, bench.kinematics, time += 0.002);
    const CarrierPoses now = carrier(bench.arm, bench.kinematics);
    if (byJoints().p.x() <= start.p.x() + 0.01 - 9e-5) break;
    EXPECT_NEAR(now.at.p.x(), end, 1e-12) << "the gap is crossed first";
    EXPECT_EQ(now.after.p.x(), now.before.p.x());
  }
  advance(bench.arm, bench.kinematics, 2.0);
  EXPECT_NEAR(lost().x(), 5e-5, 1e-12);
}

TEST(EmulatedArm, StopsByItselfUnderForce) {
  Bench bench;
  bench.start();
  Vector6 push = Vector6::Zero();
  push(0) = 149.0;
  load(bench.arm, push);
  EXPECT_FALSE(bench.arm.stopped);
  push(0) = 151.0;
  load(bench.arm, push);
  EXPECT_TRUE(bench.arm.stopped);
  EXPECT_NE(bench.arm.why.find("protective stop"), std::string::npos);
  command(bench.arm, bench.turned(0, 0.1), 0.0);
  advance(bench.arm, bench.kinematics, 1.0);
  EXPECT_LT((bench.arm.q - bench.q).norm(), 1e-12);
  unlock(bench.arm);
  command(bench.arm, bench.turned(0, 0.1), 1.0);
  advance(bench.arm, bench.kinematics, 2.0);
  EXPECT_NEAR(bench.arm.q(0) - bench.q(0), 0.1, 1e-6);
}

TEST(EmulatedArm, RefusesInvalidCommands) {
  Bench bench;
  bench.start();
  JointVector bad = bench.q;
  bad(3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(command(bench.arm, bad, 0.0));
  EXPECT_FALSE(command(bench.arm, JointVector::Zero(5), 0.0));
  advance(bench.arm, bench.kinematics, 1.0);
  EXPECT_EQ(bench.arm.q, bench.q);
}

}  // namespace
}  // namespace assembly_cell
