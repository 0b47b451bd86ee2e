// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "allocations.h"
#include "assembly_cell/arm/command_motion.h"

namespace assembly_cell {
namespace {

CommandMotion motionAt(const Pose& X) {
  CommandMotion motion;
  motion.smoothing = 10;
  beginMotion(motion, X);
  return motion;
}

Pose upright(double x, double y, double z) { return {Eigen::Matrix3d::Identity(), {x, y, z}}; }

double weighedNorm(const CommandMotion& motion, Vector6 way) {
  way.tail<3>() *= motion.limits.arm;
  return way.norm();
}

int pointsToRest(CommandMotion& motion) {
  int points = 0;
  while (!isAtRest(motion) && points < 100000) {
    stepMotion(motion);
    ++points;
  }
  return points;
}

TEST(CommandMotion, RestsAtItsStart) {
  CommandMotion motion =
      motionAt({rotationFromVector({Eigen::Vector3d(0.1, -0.2, 0.05)}), {0.012, -0.034, 0.056}});
  const Vector6 start = motion.out;
  for (int i = 0; i < 100; ++i) {
    stepMotion(motion);
    ASSERT_LT((motion.out - start).norm(), 1e-15);
  }
  EXPECT_TRUE(isAtRest(motion));
}

// Bang-bang in closed form: d/v + v/a for a distance at full speed, 2 √(d/a) for a short one, plus
// the length of the mean.
TEST(CommandMotion, TakesTheTimeOfTheFastestMoveAndTheMean) {
  for (const double distance : {0.0004, 0.001, 0.0025, 0.01, 0.05}) {
    CommandMotion motion = motionAt(Pose());
    ASSERT_TRUE(moveTo(motion, upright(0.0, distance, 0.0), 1.0));
    const double v = motion.limits.speed, a = motion.limits.acceleration;
    const double time = distance > v * v / a ? distance / v + v / a : 2.0 * std::sqrt(distance / a);
    const double mean = motion.period * static_cast<double>(motion.smoothing - 1);
    // a period and a half at either end: the path has whole ones
    EXPECT_NEAR(pointsToRest(motion) * motion.period, time + mean, 3.0 * motion.period) << distance;
    EXPECT_LT((motion.out - coordinatesOf(upright(0.0, distance, 0.0))).norm(), 1e-12);
  }
}

TEST(CommandMotion, GoesStraight) {
  const Pose goal{rotationFromVector({Eigen::Vector3d(0.1, 0.05, -0.1)}), {0.03, -0.02, 0.01}};
  CommandMotion motion = motionAt(Pose());
  ASSERT_TRUE(moveTo(motion, goal, 1.0));
  const Vector6 direction = coordinatesOf(goal).normalized();
  while (!isAtRest(motion)) {
    stepMotion(motion);
    ASSERT_LT((motion.out - direction * direction.dot(motion.out)).norm(), 1e-12);
  }
}

// Bound of a mean over n points of an acceleration that changes by at most 2 a: 2 a / (n period).
TEST(CommandMotion, AccelerationIsContinuous) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> anywhere(-0.1, 0.1), chance(0.0, 1.0);
  CommandMotion motion = motionAt(Pose());
  Vector6 before = Vector6::Zero(), rate = before, acceleration = before;
  const double n = static_cast<double>(motion.smoothing), T = motion.period;
  const double jerk = 2.0 * motion.limits.acceleration / (n * T);
  double largest = 0.0;
  for (int i = 0; i < 20000; ++i) {
    if (chance(random) < 0.02) {
      moveTo(motion, upright(anywhere(random), anywhere(random), anywhere(random)), 1.0);
    }
    if (chance(random) < 0.005) brake(motion);
    stepMotion(motion);
    const Vector6 now_rate = (motion.out - before) / T, now = (now_rate - rate) / T;
    const double change = weighedNorm(motion, now - acceleration) / T;
    ASSERT_LE(change, jerk * (1.0 + 1e-6));
    largest = std::max(largest, change);
    before = motion.out;
    rate = now_rate;
    acceleration = now;
  }
  EXPECT_GT(largest, 0.3 * jerk);
}

TEST(CommandMotion, BrakesToItsRestPoint) {
  std::mt19937_64 random(5);
  std::uniform_int_distribution<int> points(1, 200);
  for (int run = 0; run < 200; ++run) {
    CommandMotion motion = motionAt(Pose());
    moveTo(motion, upright(0.09, -0.05, 0.03), 1.0);
    for (int i = points(random); i > 0; --i) stepMotion(motion);
    if (run % 2 == 0) moveTo(motion, upright(-0.05, 0.09, 0.01), 1.0);
    for (int i = points(random) / 4; i > 0; --i) stepMotion(motion);
    brake(motion);
    const Vector6 predicted = restPoint(motion);
    const double speed = weighedNorm(motion, motion.step) / motion.period;
    const int took = pointsToRest(motion);
    EXPECT_LT((motion.out - predicted).norm(), 1e-12);
    EXPECT_LE(took, speed / motion.limits.acceleration / motion.period + 2.0 +
                        static_cast<double>(motion.smoothing));
  }
}

TEST(CommandMotion, RefusesGoalsOutsideItsLimits) {
  CommandMotion motion = motionAt(Pose());
  constexpr double kNotFinite = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(moveTo(motion, upright(kNotFinite, 0, 0), 1.0));
  EXPECT_FALSE(moveTo(motion, upright(0, kInf, 0), 1.0));
  EXPECT_FALSE(moveTo(motion, upright(0, 0, 0.1001), 1.0));
  EXPECT_FALSE(moveTo(motion, {Eigen::Matrix3d::Constant(kNotFinite), {0, 0, 0}}, 1.0));
  EXPECT_FALSE(moveTo(motion, {rotationFromVector({Eigen::Vector3d(0.36, 0, 0)}), {0, 0, 0}}, 1.0));
  EXPECT_FALSE(moveTo(motion, upright(0.01, 0, 0), kNotFinite));
  EXPECT_FALSE(moveTo(motion, upright(0.01, 0, 0), -1.0));
  stepMotion(motion);
  EXPECT_TRUE(isAtRest(motion));
}

// A million commands within the limits and far beyond, NaN, changed or braked at any time, with any
// speed. None leaves the limits of box, cone, speed or acceleration.
TEST(CommandMotion, AMillionHostileCommandsStayWithinTheLimits) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0), chance(0.0, 1.0);
  CommandMotion motion = motionAt(Pose());
  const MotionLimits& limits = motion.limits;
  Vector6 before = motion.out, rate = Vector6::Zero();
  double fastest = 0.0, hardest = 0.0, farthest = 0.0, widest = 0.0;
  const auto sinceTheStart = test::allocationsOfThisThread();
  for (int i = 0; i < 1000000; ++i) {
    const double kind = chance(random);
    const double size = kind < 0.5 ? 0.1 : kind < 0.9 ? 0.3 : 1e6;
    Vector6 x;
    for (double& value : x) value = size * unit(random);
    x.tail<3>() *= 3.0;
    if (kind > 0.97) x(i % 6) = std::numeric_limits<double>::quiet_NaN();
    if (kind > 0.98) x(i % 6) = -std::numeric_limits<double>::infinity();
    if (kind < 0.3) x.head<3>() = 0.1 * x.head<3>().cwiseSign();  // the corners
    moveTo(motion, poseOfCoordinates(x), chance(random) < 0.5 ? 1.0 : 0.1 * chance(random));
    if (chance(random) < 0.05) brake(motion);
    // most commands are replaced before they are reached
    const int points = chance(random) < 0.001 ? 2000 : chance(random) < 0.03 ? 50 : 1;
    for (int k = 0; k < points; ++k) {
      stepMotion(motion);
      const Vector6 now = (motion.out - before) / motion.period;
      fastest = std::max(fastest, weighedNorm(motion, now));
      hardest = std::max(hardest, weighedNorm(motion, now - rate) / motion.period);
      farthest = std::max(farthest, motion.out.head<3>().cwiseAbs().maxCoeff());
      widest = std::max(widest, motion.out.tail<3>().norm());
      rate = now;
      before = motion.out;
    }
  }
  EXPECT_EQ(test::allocationsOfThisThread(), sinceTheStart);
  EXPECT_LE(fastest, limits.speed * (1.0 + 1e-9));
  EXPECT_LE(hardest, limits.acceleration * (1.0 + 1e-6));
  EXPECT_LE(farthest, 0.1 + 1e-9);
  EXPECT_LE(widest, limits.rotation + 1e-9);
  // and they were reached
  EXPECT_GT(fastest, 0.99 * limits.speed);
  EXPECT_GT(hardest, 0.9 * limits.acceleration);
  EXPECT_GT(farthest, 0.0999);
  EXPECT_GT(widest, 0.34);
}

}  // namespace
}  // namespace assembly_cell
