// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The rig of thesis chapter 5.
#include "assembly_cell/vibration/rig.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support/refusals.h"
#include "support/thesis_forms.h"

namespace assembly_cell {
namespace {

RigCase rig(double x0, double M, double f = 4) { return {x0, M, f, .075, 9806.6}; }

// 4 Hz: time and cycles, worked out apart from this code to the digits given; 0: never
TEST(Rig, Table) {
  constexpr double kM[] = {10, 12.5, 15, 17.5, 20, 22.5, 25};
  struct Row {
    double x0, time[7];
    int cycles[7];
  };
  const Row rows[] = {{5, {.262, .117, .117, .117, .117, .117, .117}, {2, 1, 1, 1, 1, 1, 1}},
                      {10, {.575, .558, .545, .534, .523, .511, .367}, {3, 3, 3, 3, 3, 3, 2}},
                      {15, {1.293, 1.047, .846, .831, .818, .808, .798}, {6, 5, 4, 4, 4, 4, 4}},
                      {20, {0, 1.829, 1.539, 1.322, 1.280, 1.100, 1.088}, {0, 8, 7, 6, 6, 5, 5}},
                      {25, {0, 0, 2.556, 2.052, 1.807, 1.592, 1.564}, {0, 0, 11, 9, 8, 7, 7}},
                      {30, {0, 0, 0, 3.295, 2.574, 2.305, 2.077}, {0, 0, 0, 14, 11, 10, 9}},
                      {35, {0, 0, 0, 0, 4.048, 3.268, 2.814}, {0, 0, 0, 0, 17, 14, 12}},
                      {40, {0, 0, 0, 0, 0, 4.811, 3.821}, {0, 0, 0, 0, 0, 20, 16}},
                      {45, {0, 0, 0, 0, 0, 0, 5.580}, {0, 0, 0, 0, 0, 0, 23}}};
  for (const Row& row : rows) {
    for (int k = 0; k < 7; ++k) {
      const RigResult x = rigAssembly(rig(row.x0, kM[k]));
      EXPECT_EQ(x.never, row.cycles[k] == 0);
      if (x.never) continue;
      EXPECT_NEAR(x.time, row.time[k], 5.001e-4) << row.x0 << " " << kM[k];
      EXPECT_EQ(x.cycles, row.cycles[k]) << row.x0 << " " << kM[k];
    }
  }
  for (const double f : {.5, 1.0}) {
    for (const double M : {12.6, 13.0, 25.0})
      EXPECT_NEAR(rigAssembly(rig(25, M, f)).time, .2607, 5e-5);
  }
  EXPECT_NEAR(rigAssembly(rig(25, 13)).time, 4.257, 5e-4);
  EXPECT_NEAR(rigAssembly(rig(40, 22.5, 1)).time, .968, 5e-4);
  EXPECT_NEAR(rigAssembly(rig(45, 25, 1)).time, 1.143, 5e-4);
  EXPECT_NEAR(rigOneSlideFrequency(rig(25, 25)), 1.598, 5e-4);
}

// every root of 5.6 by brute force: the stop is the first after the trivial one
TEST(Rig, ChoosesTheFirstRootThatIsNotTrivial) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  int stopped = 0, assembled = 0;
  for (int run = 0; run < 500; ++run) {
    const RigCase c{1, 0.5 + 5 * unit(random), std::pow(10, 2 * unit(random) - 1), .075, 9.8};
    const double x0 = 2 * c.M_over_L * (1e-3 + .998 * unit(random));
    const double w = 2 * M_PI * c.f_hz, A = 2 * c.M_over_L, b0 = std::acos(x0 / A);
    const auto f = [&](double t) { return c.K * c.g * t * t / 2 - x0 + A * std::cos(w * t - b0); };
    double expected = std::sqrt(2 * x0 / (c.K * c.g));
    const int kSteps = 50000;
    const double step = (b0 + M_PI / 2) / w / kSteps;
    for (int k = 2; k <= kSteps && k * step < expected; ++k) {
      // the trivial root is left behind after the first steps: f > 0 up to 2 b0
      if (k * step * w > b0 && f(k * step) <= 0) expected = k * step;
    }
    const RigSlide s = rigSlide(c, x0);
    // one step of the search; a root that only touches zero may fall between steps
    EXPECT_NEAR(s.time, expected, 1.01 * step) << run;
    EXPECT_GT(s.time, 0);
    if (s.x > 0) {
      // on the rule of tipping: x = A cos b, 5.4
      EXPECT_NEAR(s.x, A * std::cos(w * s.time - b0), 1e-12 * A);
      ++stopped;
    } else {
      EXPECT_NEAR(s.time, std::sqrt(2 * x0 / (c.K * c.g)), 1e-12 * s.time);
      ++assembled;
    }
  }
  EXPECT_GT(stopped, 50);
  EXPECT_GT(assembled, 50);
}

// only x0/A and Kg/(A w²) matter
TEST(Rig, ScalesWithUnitsAndRatios) {
  const RigResult a = rigAssembly(rig(20, 15)), b = rigAssembly({.020, .015, 4, .075, 9.8066});
  EXPECT_NEAR(a.time, b.time, 1e-12);
  const RigResult twice = rigAssembly({20, 15, 8, .3, 9806.6});
  EXPECT_NEAR(a.time, 2 * twice.time, 1e-12);
  EXPECT_EQ(a.cycles, twice.cycles);
}

TEST(Rig, Trends) {
  for (double M = 13; M < 25; M += 1) {
    EXPECT_LE(rigAssembly(rig(25, M + 1)).time, rigAssembly(rig(25, M)).time);
  }
  for (double x0 = 5; x0 < 45; x0 += 1) {
    EXPECT_GT(rigAssembly(rig(x0 + 1, 25)).time, rigAssembly(rig(x0, 25)).time);
  }
}

TEST(Rig, Refusals) {
  EXPECT_NE(refusalOf([] { rigAssembly(rig(0, 25)); }).find("x0: value 0.0"), std::string::npos);
  EXPECT_NE(refusalOf([] { rigAssembly(rig(25, 25, 0)); }).find("f_hz"), std::string::npos);
  EXPECT_NE(refusalOf([] { rigSlide(rig(25, 10), 25); }).find("x: value 25.0"), std::string::npos);
  EXPECT_TRUE(rigAssembly(rig(50, 25)).never);
  // the knife edge: never, whatever the rounding; just inside it a long but finite time
  EXPECT_TRUE(rigAssembly(rig(50, std::nextafter(25, 26))).never);
  EXPECT_GT(rigAssembly(rig(50 * (1 - 1e-9), 25)).cycles, 30);
  EXPECT_NE(refusalOf([] { rigOneSlideFrequency(rig(50, 25)); }).find("x0"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
