// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/common/drift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/devices/replay.h"

namespace assembly_cell {
namespace {

using Signal = std::vector<Vector6>;

Vector6 axisSignal(int axis, double value) {
  Vector6 x = Vector6::Zero();
  x[axis] = value;
  return x;
}

Signal whiteNoise(std::size_t count, double sd, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, sd);
  Signal signal(count);
  for (Vector6& x : signal) {
    for (double& value : x) value = normal(random);
  }
  return signal;
}

SettlingReport reportOf(const Signal& signal, const SettlingLimits& limits) {
  SettledWindow window(limits);
  for (const Vector6& x : signal) window.add(x);
  return window.report();
}

TEST(SettledWindow, SlidingSumsAgreeWithTheSamplesThemselves) {
  SettlingLimits limits;
  limits.window = 17;
  Signal signal = whiteNoise(200, 1.0, 1);
  for (std::size_t i = 0; i < signal.size(); ++i) signal[i][2] += 1e4 + 0.1 * double(i);
  SettledWindow window(limits);
  for (std::size_t i = 0; i < signal.size(); ++i) {
    window.add(signal[i]);
    if (i + 1 < limits.window) continue;
    const SettlingReport report = window.report();
    const double n = double(limits.window), centre = 0.5 * (n - 1.0);
    for (int a = 0; a < 6; ++a) {
      double mean = 0.0, moment = 0.0, square = 0.0, residual = 0.0;
      for (std::size_t k = 0; k < limits.window; ++k) mean += signal[i + 1 - 17 + k][a] / n;
      for (std::size_t k = 0; k < limits.window; ++k) {
        moment += (double(k) - centre) * (signal[i + 1 - 17 + k][a] - mean);
        square += (double(k) - centre) * (double(k) - centre);
      }
      for (std::size_t k = 0; k < limits.window; ++k) {
        const double r = signal[i + 1 - 17 + k][a] - mean - moment / square * (double(k) - centre);
        residual += r * r;
      }
      // rounding of 1e4 in double is 2e-12
      EXPECT_NEAR(report.mean[a], mean, 1e-9);
      EXPECT_NEAR(report.change[a], moment / square * (n - 1.0), 1e-9);
      EXPECT_NEAR(report.sd[a], std::sqrt(residual / (n - 2.0)), 1e-9);
    }
  }
}

TEST(SettledWindow, WhiteNoiseIsSettled) {
  // P(|x - mean| > 5 sd) = 6e-7 a sample: 300 windows of 50 x 6 are called unsettled in 5 % of runs
  // at most once; noise taken from differences has 10 % error in 50 samples, which makes it 3e-5
  for (const double given : {1.0, 0.0}) {
    SettlingLimits limits;
    limits.noise.setConstant(given);
    int false_alarms = 0;
    for (unsigned seed = 0; seed < 300; ++seed) {
      false_alarms += reportOf(whiteNoise(50, 1.0, seed), limits).verdict != Settling::kSettled;
    }
    EXPECT_LE(false_alarms, given > 0.0 ? 1 : 6);
  }
}

TEST(SettledWindow, NamesWhatIsWrong) {
  SettlingLimits limits;
  limits.noise.setConstant(1.0);
  Signal spike = whiteNoise(50, 1.0, 2), ramp = spike, swing = spike;
  spike[20] += axisSignal(3, 9.0);
  for (std::size_t i = 0; i < 50; ++i) {
    ramp[i] += axisSignal(1, 0.12 * double(i));
    swing[i] += axisSignal(5, 8.0 * std::sin(0.3 * double(i)));
  }
  SettlingReport report = reportOf(spike, limits);
  EXPECT_EQ(report.verdict, Settling::kSpread);
  EXPECT_EQ(report.axis, 3);
  report = reportOf(ramp, limits);
  EXPECT_EQ(report.verdict, Settling::kTrend);
  EXPECT_EQ(report.axis, 1);
  EXPECT_NEAR(report.change[1], 0.12 * 49, 4.0 * report.change_sd[1]);
  report = reportOf(swing, limits);
  EXPECT_EQ(report.verdict, Settling::kSpread);
  EXPECT_EQ(report.axis, 5);
  // a ramp without noise is unsettled although its noise is unknown; a constant is settled
  limits.noise.setZero();
  Signal pure(50), still(50, axisSignal(0, 3.0));
  for (std::size_t i = 0; i < 50; ++i) pure[i] = axisSignal(2, 1e-6 * double(i));
  EXPECT_NE(reportOf(pure, limits).verdict, Settling::kSettled);
  EXPECT_EQ(reportOf(still, limits).verdict, Settling::kSettled);
}

TEST(SettledWindow, SerialCorrelationWidensTheMean) {
  // AR(1), rho = 0.8: variance of the mean of n is sigma^2/n (1 + rho)/(1 - rho) for n large
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  SettlingLimits limits;
  limits.window = 400;
  Signal signal(400);
  double state = 0.0;
  for (Vector6& x : signal) x = axisSignal(0, state = 0.8 * state + 0.6 * normal(random));
  const SettlingReport report = reportOf(signal, limits);
  EXPECT_NEAR(std::sqrt(report.variance[0] / (9.0 / 400.0)), 1.0, 0.4);  // rho is known to 3 %
}

TEST(SettledWindow, GapsAndBadSamplesRestartTheWindow) {
  SettlingLimits limits;
  limits.window = 8;
  SettledWindow window(limits);
  EXPECT_EQ(window.report().verdict, Settling::kFilling);
  for (int i = 0; i < 12; ++i) window.add(Vector6::Ones());
  EXPECT_TRUE((window.report().verdict == Settling::kSettled));
  window.add(Vector6::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(window.report().samples, 0u);
  for (int i = 0; i < 7; ++i) window.add(Vector6::Ones());
  EXPECT_EQ(window.report().verdict, Settling::kFilling);
  window.add(Vector6::Ones());
  EXPECT_TRUE((window.report().verdict == Settling::kSettled));

  limits.window = 7;
  EXPECT_THROW(SettledWindow{limits}, InputError);
  limits = SettlingLimits();
  limits.noise[4] = -1.0;
  EXPECT_THROW(SettledWindow{limits}, InputError);
  limits = SettlingLimits();
  limits.trend = std::numeric_limits<double>::infinity();
  EXPECT_THROW(SettledWindow{limits}, InputError);
}

// A real sensor on a robot: it moves until 10.9 s, stands until 24.4 s and moves again (seen in the
// recorded orientation, which the detector doesn't get).
TEST(SettledWindow, RealRecording) {
  const Recording recording =
      loadRecording(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/test/data/drift.csv", {});
  SettlingLimits limits;
  limits.window = 20;                                  // 2 s
  limits.noise << 5e-3, 5e-3, 5e-3, 5e-4, 5e-4, 5e-4;  // what the calibration is to resolve
  SettledWindow window(limits);
  std::vector<bool> settled;
  for (const Vector6& x : recording.values) {
    window.add(x);
    settled.push_back((window.report().verdict == Settling::kSettled));
  }
  ASSERT_EQ(settled.size(), 300u);
  const auto count = [&](std::size_t from, std::size_t to) {
    return std::count(settled.begin() + long(from), settled.begin() + long(to), true);
  };
  EXPECT_EQ(count(0, 108), 0);      // moving
  EXPECT_EQ(count(135, 243), 108);  // standing, window past the end of the motion
  EXPECT_EQ(count(252, 300), 0);    // moving again
  // the finer yardstick of the sensor's own noise sees its creep of 6 mN/s in z
  limits.noise.setZero();
  SettledWindow fine(limits);
  int trends = 0;
  for (std::size_t i = 0; i < 243; ++i) {
    fine.add(recording.values[i]);
    if (i >= 205) trends += fine.report().verdict == Settling::kTrend && fine.report().axis == 2;
  }
  EXPECT_GE(trends, 30);
}

}  // namespace
}  // namespace assembly_cell
