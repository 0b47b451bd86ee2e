// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "assembly_cell/align/strategies/search_area.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;

// A hole of 5 mm radius within 15 mm: discs of 4 mm radius that don't overlap would be 14.
TEST(SearchArea, TouchesComeWithinReachOfEachCentre) {
  const Vector2d start(0.002, -0.001);
  std::vector<Vector2d> touched;
  while (const std::optional<Vector2d> next = nextPlace(start, 0.015, 0.004, touched, start)) {
    touched.push_back(*next);
    ASSERT_LT(touched.size(), 40u);
  }
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(-0.015, 0.015);
  for (int i = 0; i < 1000; ++i) {
    const Vector2d off(uniform(engine), uniform(engine));
    if (off.norm() > 0.015) continue;
    double nearest = 1.0;
    for (const Vector2d& touch : touched) {
      nearest = std::min(nearest, (start + off - touch).norm());
    }
    EXPECT_LT(nearest, 0.005) << off.transpose();  // the reach and the spacing of the grid
  }
}

TEST(SearchArea, NextIsWhereMostIsLeftAndThenNearest) {
  const auto first = nextPlace(Vector2d::Zero(), 0.015, 0.004, {}, Vector2d(0.01, 0.0));
  const auto mirrored = nextPlace(Vector2d::Zero(), 0.015, 0.004, {}, Vector2d(-0.01, 0.0));
  ASSERT_TRUE(first && mirrored);
  EXPECT_LT(first->norm(), 0.012);  // its disc is within the region
  EXPECT_GT(first->x(), 0.004);
  EXPECT_NEAR(mirrored->x(), -first->x(), 1e-12);
  std::vector<Vector2d> right;
  for (double y = -0.015; y <= 0.015; y += 0.002) right.emplace_back(0.0, y);
  for (double y = -0.015; y <= 0.015; y += 0.002) right.emplace_back(0.006, y);
  for (double y = -0.015; y <= 0.015; y += 0.002) right.emplace_back(0.012, y);
  const auto left = nextPlace(Vector2d::Zero(), 0.015, 0.004, right, Vector2d(0.01, 0.0));
  ASSERT_TRUE(left);
  EXPECT_LT(left->x(), -0.004);
}

TEST(SearchArea, NothingIsLeftWhereEachCentreIsRuledOut) {
  EXPECT_FALSE(nextPlace(Vector2d::Zero(), 0.015, 0.02, {Vector2d::Zero()}, Vector2d::Zero()));
}

}  // namespace
}  // namespace assembly_cell
