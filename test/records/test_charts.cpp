// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/charts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Charts, EwmaFollowsItsFormulas) {
  EwmaSettings settings;
  settings.baseline = 0;
  settings.mean = 10.0;
  settings.sd = 2.0;
  settings.lambda = 0.25;
  settings.L = 3.0;
  const EwmaChart chart = ewmaChart({12.0, 8.0, 30.0}, settings);
  ASSERT_EQ(chart.points.size(), 3u);
  EXPECT_DOUBLE_EQ(chart.points[0].z, 10.5);
  EXPECT_DOUBLE_EQ(chart.points[1].z, 0.25 * 8.0 + 0.75 * 10.5);
  // the first has λ sd, not the standard deviation after many
  EXPECT_NEAR(chart.points[0].high, 10.0 + 3.0 * 0.25 * 2.0, 1e-12);
  EXPECT_NEAR(chart.points[1].high, 10.0 + 3.0 * 2.0 * 0.25 * std::sqrt(1.0 + 0.75 * 0.75), 1e-12);
  EXPECT_EQ(chart.outside, 1u);
  EXPECT_EQ(chart.first_outside, 2u);
}

// Lucas and Saccucci (Technometrics 32, 1990): λ = 0.1, L = 2.814 has a mean run length of 500 with
// constant limits. Those of the first points are narrower here, which shortens it by a few per
// cent. 4000 runs: standard error 1.6 %.
TEST(Charts, MeanRunLengthWithoutDriftIsThePublishedOne) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  EwmaSettings settings;
  settings.baseline = 0;
  settings.sd = 1.0;
  double sum = 0.0;
  constexpr int kRuns = 4000;
  std::vector<double> values(6000);
  for (int run = 0; run < kRuns; ++run) {
    for (double& value : values) value = normal(random);
    sum += static_cast<double>(ewmaChart(values, settings).first_outside + 1);
  }
  EXPECT_NEAR(sum / kRuns, 500.0, 0.1 * 500.0);
}

TEST(Charts, DriftOfOneStandardDeviationIsFoundSoon) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (int i = 0; i < 400; ++i) values.push_back(normal(random) + (i < 300 ? 0.0 : 1.0));
  EwmaSettings settings;
  settings.baseline = 200;
  const EwmaChart chart = ewmaChart(values, settings);
  EXPECT_GE(chart.first_outside, 300u);
  EXPECT_LE(chart.first_outside, 330u);
}

TEST(Charts, WhatHasNoChartIsRefusedByName) {
  const auto refusal = [](const std::vector<double>& values, EwmaSettings settings) {
    try {
      ewmaChart(values, settings);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal(std::vector<double>(30, 5.0), {}),
            "baseline: the first 25 values are all 5: without spread there are no limits");
  EXPECT_EQ(refusal({1.0, 2.0}, {}),
            "baseline: value 25: there are 2 values: give fewer, or wait for 26 values");
  EXPECT_EQ(refusal({1.0, std::nan(""), 2.0}, {0.1, 3.0, 2}), "value 2 isn't a number");
}

// Bissell's interval is an approximation: 95 % within 3 % (n = 50, standard error of 4000 sets
// 0.35 %); Kane's is exact for normal values.
TEST(Charts, IntervalsOfCapabilityCoverTheTrueOneAsOftenAsStated) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(10.0, 0.5);
  const double lower = 8.0, upper = 12.5;  // Cp 1.5, Cpk 4/3
  constexpr int kSets = 4000;
  int cp = 0, cpk = 0;
  for (int set = 0; set < kSets; ++set) {
    std::vector<double> values(50);
    for (double& value : values) value = normal(random);
    const Capability c = capability(values, lower, upper);
    cp += c.cp.low <= 1.5 && 1.5 <= c.cp.high ? 1 : 0;
    cpk += c.cpk.low <= 4.0 / 3.0 && 4.0 / 3.0 <= c.cpk.high ? 1 : 0;
  }
  EXPECT_NEAR(double(cp) / kSets, 0.95, 3.0 * std::sqrt(0.95 * 0.05 / kSets));
  EXPECT_NEAR(double(cpk) / kSets, 0.95, 0.03);
}

TEST(Charts, CapabilityOfOneLimitAndRefusals) {
  const Capability c = capability({1.0, 2.0, 3.0}, -kInfinity, 5.0);
  EXPECT_DOUBLE_EQ(c.cpk.estimate, 1.0);
  EXPECT_TRUE(std::isnan(c.cp.estimate));
  EXPECT_THROW(capability({1.0, 1.0}, 0.0, 2.0), InputError);
  EXPECT_THROW(capability({1.0}, 0.0, 2.0), InputError);
  EXPECT_THROW(capability({1.0, 2.0}, 2.0, 2.0), InputError);
  EXPECT_THROW(capability({1.0, 2.0}, -kInfinity, kInfinity), InputError);
}

}  // namespace
}  // namespace assembly_cell
