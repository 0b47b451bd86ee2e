// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {
namespace {

// Two-pass formulas on the same data; rounding only. A large mean is where a naive sum loses
// digits.
TEST(Moments, EqualTwoPassFormulas) {
  NormalSource normal(7);
  std::vector<Vector6> data(500);
  for (Vector6& x : data) {
    for (int k = 0; k < 6; ++k) x[k] = 1e6 * k + std::pow(10.0, -k) * normal();
  }
  Moments moments;
  Vector6 mean = Vector6::Zero(), squares = Vector6::Zero();
  for (const Vector6& x : data) {
    moments.add(x);
    mean += x / 500.0;
  }
  for (const Vector6& x : data) squares += (x - mean).cwiseAbs2();
  EXPECT_EQ(moments.count(), 500u);
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(moments.mean()[k], mean[k], 1e-14 * 1e6 * (k + 1));
    EXPECT_NEAR(moments.sd()[k] / std::sqrt(squares[k] / 499.0), 1.0, 1e-4);
  }
}

TEST(Moments, OfFewSamples) {
  Moments moments;
  EXPECT_TRUE(moments.sd().isZero(0.0));
  moments.add(Vector6::Ones());
  EXPECT_TRUE(moments.sd().isZero(0.0));
  EXPECT_EQ(moments.mean(), Vector6::Ones());
}

// White noise on a ramp that is a hundred times larger: 3 % is 5 sigma of an estimate from 20000.
TEST(DifferenceNoise, SeesThroughDrift) {
  NormalSource normal(9);
  DifferenceNoise noise;
  for (int i = 0; i < 20000; ++i) {
    Vector6 x;
    for (int k = 0; k < 6; ++k) x[k] = 0.1 * (k + 1) * normal() + 1e-3 * i;
    noise.add(x);
  }
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(noise.rms()[k] / (0.1 * (k + 1)), 1.0, 0.03);
}

TEST(DifferenceNoise, DoesNotBridgeABreak) {
  DifferenceNoise noise;
  noise.add(Vector6::Zero());
  noise.breakRun();
  noise.add(Vector6::Constant(1e6));
  EXPECT_EQ(noise.count(), 0u);
  noise.add(Vector6::Constant(1e6 + 2.0));
  EXPECT_EQ(noise.count(), 1u);
  EXPECT_DOUBLE_EQ(noise.rms()[0], std::sqrt(2.0));
  noise.clear();
  noise.add(Vector6::Constant(1e6 + 2.0));
  EXPECT_EQ(noise.count(), 1u);
  EXPECT_EQ(noise.rms()[0], 0.0);
}

TEST(SequenceMonitor, CountsWhatIsMissingAndWhatCameTwice) {
  SequenceMonitor monitor;
  EXPECT_EQ(monitor.accept(500), Arrival::kNext);
  EXPECT_EQ(monitor.accept(501), Arrival::kNext);
  EXPECT_EQ(monitor.accept(505), Arrival::kLoss);
  EXPECT_EQ(monitor.lost(), 3u);
  EXPECT_EQ(monitor.accept(505), Arrival::kDuplicate);
  EXPECT_EQ(monitor.accept(405), Arrival::kDuplicate);
  EXPECT_EQ(monitor.duplicates(), 2u);
  EXPECT_EQ(monitor.accept(506), Arrival::kNext);
  EXPECT_EQ(monitor.restarts(), 0u);
}

TEST(SequenceMonitor, NewCountsAreAccepted) {
  SequenceMonitor monitor;
  monitor.accept(5000);
  EXPECT_EQ(monitor.accept(4899), Arrival::kRestart);  // 101 behind: more than any queue holds
  EXPECT_EQ(monitor.accept(4900), Arrival::kNext);
  EXPECT_EQ(monitor.accept(0), Arrival::kRestart);
  EXPECT_EQ(monitor.accept(1), Arrival::kNext);
  EXPECT_EQ(monitor.accept(7), Arrival::kLoss);
  EXPECT_EQ(monitor.accept(0), Arrival::kRestart);
  EXPECT_EQ(monitor.restarts(), 3u);
  EXPECT_EQ(monitor.lost(), 5u);
}

TEST(SequenceMonitor, WrapsAround) {
  SequenceMonitor monitor;
  monitor.accept(0xfffffffeu);
  EXPECT_EQ(monitor.accept(0xffffffffu), Arrival::kNext);
  EXPECT_EQ(monitor.accept(0u), Arrival::kNext);
  EXPECT_EQ(monitor.accept(2u), Arrival::kLoss);
  EXPECT_EQ(monitor.accept(0xffffffffu), Arrival::kDuplicate);
}

}  // namespace
}  // namespace assembly_cell
