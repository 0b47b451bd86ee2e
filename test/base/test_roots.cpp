// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Roots and distributions: against a loop by hand and the tables.

#include "assembly_cell/math/roots.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "assembly_cell/math/distributions.h"

namespace assembly_cell {
namespace {

TEST(Bisect, GivesTheBitsOfALoopByHand) {
  for (int k = 1; k < 200; ++k) {
    const double root = std::sqrt(k) / 3.0;
    const auto holds = [root](double x) { return x <= root; };
    for (const int halvings : {1, 20, 60, 200}) {
      double low = -0.1, high = 5.0;
      for (int i = 0; i < halvings; ++i) {
        const double middle = 0.5 * (low + high);
        (holds(middle) ? low : high) = middle;
      }
      const Bracket found = bisect(-0.1, 5.0, holds, 0.0, halvings);
      EXPECT_EQ(found.low, low);
      EXPECT_EQ(found.high, high);
    }
    const Bracket wide = bisect(-0.1, 5.0, holds, 1e-3);
    EXPECT_LE(wide.high - wide.low, 1e-3);
    EXPECT_GT(wide.high - wide.low, 4e-4);
  }
}

TEST(Bisect, EvaluatesBetweenTheEndsOnly) {
  const auto inside = [](double x) {
    EXPECT_TRUE(x > 0.0 && x < 1.0);
    return true;
  };
  EXPECT_EQ(bisect(0.0, 1.0, inside).high, 1.0);
}

TEST(RootIn, IsThereInAFewCalls) {
  for (int k = 1; k < 200; ++k) {
    int calls = 0;
    const auto cubic = [&](double x) {
      ++calls;
      return x * x * x - k;
    };
    const Bracket found = rootIn(0.0, 10.0, cubic, 1e-14);
    EXPECT_NEAR(found.low, std::cbrt(k), 4e-15 * std::cbrt(k) + 1e-14);
    EXPECT_LE(found.high - found.low, 1e-14);
    EXPECT_LE(found.low, found.high);
    EXPECT_LT(calls, 20);
  }
}

TEST(RootIn, WantsUnlikeSigns) {
  const auto above = [](double x) { return x + 1.0; };
  EXPECT_THROW(rootIn(0.0, 1.0, above, 1e-9), std::domain_error);
}

// steps have no root between neighbours
TEST(RootIn, EndsAtAStep) {
  const auto step = [](double x) { return x < 1.0 / 3 ? -1.0 : 2.0; };
  const Bracket found = rootIn(0.0, 1.0, step, 1e-17);
  EXPECT_LT(found.low, 1.0 / 3);
  EXPECT_GE(found.high, 1.0 / 3);
  EXPECT_LT(found.high - found.low, 1e-15);
}

// Abramowitz and Stegun, tables 26.1, 26.8 and 26.9.
TEST(Distributions, AgreeWithTheTables) {
  EXPECT_NEAR(normalTail(1.959963984540054), 0.025, 1e-15);
  EXPECT_NEAR(chiSquareTail(12.5916, 6), 0.05, 1e-6);
  EXPECT_NEAR(chiSquareLimit(0.05, 6), 12.5916, 5e-5);
  EXPECT_NEAR(fTail(3.1059, 5, 12), 0.05, 1e-5);
}

TEST(Distributions, AreDefinedAtTheirEnds) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(chiSquareTail(0.0, 6), 1.0);
  EXPECT_EQ(chiSquareTail(3.0, 0), 1.0);
  EXPECT_EQ(chiSquareTail(inf, 6), 0.0);
  EXPECT_EQ(chiSquareLimit(0.1, 0), 0.0);
  EXPECT_EQ(fTail(0.0, 2, 3), 1.0);
  EXPECT_EQ(fTail(2.0, 0, 3), 1.0);
  EXPECT_EQ(fTail(inf, 2, 3), 0.0);
  // far out: the normal form meets the exact one
  EXPECT_NEAR(fTail(2500.0, 4, 400, 1.001e4), fTail(2500.0, 4, 400, 0.999e4), 0.02);
}

}  // namespace
}  // namespace assembly_cell
