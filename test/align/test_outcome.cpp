// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/outcome.h"

#include <gtest/gtest.h>

#include <cmath>

using namespace assembly_cell;

namespace {

constexpr double kRadius = 0.025;

Pose tilted(double about_y, const Eigen::Vector3d& p) {
  return {rotationFromVector({Eigen::Vector3d(0.0, about_y, 0.0)}), p};
}

TEST(Outcome, TiltIsTheRotationVectorOfTheAxis) {
  // rotation about a horizontal axis: the vector itself; a turn about the peg's axis changes
  // nothing
  const Eigen::Vector3d v(0.012, -0.02, 0.0);
  const Pose X{rotationFromVector({v}) * rotationFromVector({Eigen::Vector3d(0.0, 0.0, 1.0)}),
               Eigen::Vector3d::Zero()};
  EXPECT_LT((tiltOf(X) - v.head<2>()).norm(), 1e-15);
  EXPECT_EQ(tiltOf(Pose{}).norm(), 0.0);
}

TEST(Outcome, EdgeReachIsThatOfAnEllipse) {
  // upright and off centre: r + d
  EXPECT_NEAR(edgeReach({Eigen::Matrix3d::Identity(), Eigen::Vector3d(1e-3, 0.0, 5.0)}, kRadius),
              0.026, 1e-12);
  // tilted about y: semi-axes r cos and r, so r
  EXPECT_NEAR(edgeReach(tilted(0.3, Eigen::Vector3d::Zero()), kRadius), kRadius, 1e-12);
  // and moved along x by d: max over a of (r cos(t) cos(a) + d)² + (r sin(a))², closed form:
  // r² + d² + r² d² cos²(t) / (r² sin²(t)) where its cos(a) = d cos(t) / (r sin²(t)) < 1
  const double d = 1e-4, t = 0.3;
  const double expected = std::sqrt(kRadius * kRadius + d * d + std::pow(d / std::tan(t), 2));
  EXPECT_NEAR(edgeReach(tilted(t, Eigen::Vector3d(d, 0.0, 0.0)), kRadius), expected, 1e-12);
}

// A peg that the wall of the bore deforms reaches beyond the hole's radius, and is in the hole if
// its whole edge is below the face.
TEST(Outcome, PegAtTheWallIsInTheHoleWhereItsWholeEdgeIsBelowTheFace) {
  constexpr double kHole = kRadius + 2e-5, kReach = kHole + 5e-6, kTilt = 1e-3;
  const auto isAligned = [](double height, double chamfers, double reach) {
    return inPlace(tilted(kTilt, Eigen::Vector3d(0.0, 0.0, height)), chamfers, reach, kRadius,
                   kHole, 0.0);
  };
  EXPECT_TRUE(isAligned(-0.01, 0.0, kReach));
  EXPECT_TRUE(isAligned(-0.01, 0.0, kHole + 1.9e-5));
  EXPECT_FALSE(isAligned(-0.01, 0.0, kHole + 2.1e-5));
  // the highest point of the edge is r sin(tilt) = 25 um above its centre
  EXPECT_TRUE(isAligned(-2.3e-4, 0.0, kReach));
  EXPECT_FALSE(isAligned(-2.2e-4, 0.0, kReach));
  EXPECT_TRUE(isAligned(-2.2e-4, 0.0, kHole));
  // with chamfers the shoulder has to be so far below the rim of the bore
  EXPECT_FALSE(isAligned(-2.3e-4, 1e-4, kReach));
}

}  // namespace
