// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/integrate_twice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kRate = 5000;

// whole periods, offset and all: exact; odd and prime lengths, too
TEST(IntegrateTwice, ExactOverWholePeriods) {
  for (const std::size_t n : {500u, 1000u, 997u}) {
    const double w = 2 * M_PI * kRate * 12 / static_cast<double>(n);
    std::vector<double> a;
    for (std::size_t k = 0; k < n; ++k) {
      const double t = static_cast<double>(k) / kRate;
      a.push_back(9.8 * 0.01 - w * w * 3e-6 * std::cos(w * t + 0.4) -
                  9 * w * w * 1e-7 * std::sin(3 * w * t));
    }
    const std::vector<double> x = integrateTwice(a, kRate, 0.3 * w);
    ASSERT_EQ(x.size(), n);
    for (std::size_t k = 0; k < n; ++k) {
      const double t = static_cast<double>(k) / kRate;
      EXPECT_NEAR(x[k], 3e-6 * std::cos(w * t + 0.4) + 1e-7 * std::sin(3 * w * t), 1e-15) << n;
    }
  }
}

// any window: the middle half is right to a few per cent, what wanders slowly stays out
TEST(IntegrateTwice, WanderingStaysOut) {
  const double w = 771.3;
  std::vector<double> a;
  double walk = 0.0;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 2000; ++k) {
    walk += 1e-4 * normal(random);
    a.push_back(-w * w * 3e-6 * std::cos(w * k / kRate) + 0.2 + walk);
  }
  const std::vector<double> x = integrateTwice(a, kRate, 0.5 * w);
  for (std::size_t k = 500; k < 1500; ++k) {
    EXPECT_NEAR(x[k], 3e-6 * std::cos(w * static_cast<double>(k) / kRate), 0.03 * 3e-6);
  }
}

TEST(IntegrateTwice, Refusals) {
  std::vector<double> a(100, 1.0);
  EXPECT_NO_THROW(integrateTwice(a, kRate, 100));
  for (const double x : integrateTwice(a, kRate, 100)) EXPECT_NEAR(x, 0, 1e-15);
  EXPECT_THROW(integrateTwice(a, kRate, 0), InputError);
  EXPECT_THROW(integrateTwice(a, kRate, M_PI * kRate), InputError);
  EXPECT_THROW(integrateTwice(a, 0, 100), InputError);
  EXPECT_THROW(integrateTwice({1, 2, 3}, kRate, 100), InputError);
  a[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(integrateTwice(a, kRate, 100), InputError);
}

}  // namespace
}  // namespace assembly_cell
