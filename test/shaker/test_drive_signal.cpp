// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/drive_signal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace assembly_cell {
namespace {

TEST(DriveSignal, IsTheCommandOnceItHasFadedIn) {
  DriveSignal signal;
  signal.ramp = 0.03;
  const ExciterCommand command{5.0, 620.0, 0.7, -1};
  drive(signal, command, 12.25, 20.0);
  EXPECT_EQ(forceAt(signal, 20.0).norm(), 0.0);
  double before = 0.0;
  for (double t = 20.0; t < 20.03; t += 1e-3) {
    EXPECT_GE(forceAt(signal, t).norm(), before);
    before = forceAt(signal, t).norm();
  }
  for (double t = 20.03; t < 21.0; t += 0.0137) {
    const long double angle = -(620.0L * (static_cast<long double>(t) - 12.25L) + 0.7L);
    const Eigen::Vector2d expected(static_cast<double>(5.0L * std::cos(angle)),
                                   static_cast<double>(5.0L * std::sin(angle)));
    // 620 rad/s by 1e-15 of 20 s, and as much of the angle
    EXPECT_LT((forceAt(signal, t) - expected).norm(), 5.0 * 5e-12);
  }
}

TEST(DriveSignal, IsOffWithinAPeriod) {
  DriveSignal signal;
  signal.ramp = 0.5;
  drive(signal, {5.0, 620.0, 0.0, 1}, 0.0, 0.0);
  drive(signal, ExciterCommand(), 0.0, 1.0);
  EXPECT_GT(forceAt(signal, 1.0 + 0.5 * 2 * M_PI / 620.0).norm(), 1.0);
  EXPECT_EQ(forceAt(signal, 1.0 + 2 * M_PI / 620.0).norm(), 0.0);
  removeFaded(signal, 1.0 + 2 * M_PI / 620.0);
  EXPECT_EQ(signal.count, 0u);
}

// Random changes, up to three within a fade: the difference of two samples is bounded by the
// fastest fade and rotation of all voices; at the end the signal is that of the last command.
TEST(DriveSignal, ChangesWithoutAStep) {
  std::mt19937 random(3);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  DriveSignal signal;
  signal.ramp = 0.02;
  const double h = 1.0 / 48000.0;
  Eigen::Vector2d last = Eigen::Vector2d::Zero();
  double t = 0.0, largest = 0.0;
  ExciterCommand command;
  for (int change = 0; change < 200; ++change) {
    command = {uniform(0.0, 1.0) < 0.3 ? 0.0 : uniform(1.0, 10.0), uniform(100.0, 3000.0),
               uniform(-3.0, 3.0), uniform(0.0, 1.0) < 0.5 ? 1 : -1};
    drive(signal, command, 0.0, t);
    ASSERT_LE(signal.count, 4u);
    const double until = t + uniform(0.0075, 0.1);
    for (; t < until; t += h) {
      const Eigen::Vector2d now = forceAt(signal, t);
      largest = std::max(largest, (now - last).norm());
      last = now;
    }
  }
  // four voices of 10 N: 3000 rad/s, and a fade of 1.5 over 2 ms
  EXPECT_LT(largest, 4 * 10.0 * h * (3000.0 + 1.5 / 2e-3));
  t += 0.1;
  EXPECT_NEAR(forceAt(signal, t).norm(), command.amplitude, 1e-9);
}

}  // namespace
}  // namespace assembly_cell
