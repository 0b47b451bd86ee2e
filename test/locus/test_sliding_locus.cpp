// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The sliding estimate against the fit of the same window, after steps, and over long runs.
#include "assembly_cell/locus/sliding_locus.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

Complex motion(Complex P, Complex N, double a) {
  return P * std::polar(1.0, a) + N * std::polar(1.0, -a);
}

// any window, whole periods or not, either sense: both solve the same least squares
TEST(SlidingLocus, IsTheFitOfItsWindow) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 2e-7);
  for (const std::size_t window : {61u, 200u, 333u}) {
    for (const double step : {0.154, -0.4}) {
      SlidingLocus sliding(window);
      std::vector<double> angle, signals;
      for (std::size_t k = 0; k < 5 * window + 17; ++k) {
        const double a = step * static_cast<double>(k) + 0.4;
        const Complex z = motion({1e-6, 2e-6}, {-3e-7, 1e-6}, a);
        const double x = z.real() + 4e-4 + noise(random), y = z.imag() - 1e-4 + noise(random);
        ASSERT_TRUE(sliding.add(a, x, y));
        angle.push_back(a);
        signals.insert(signals.end(), {x, y, 0, 0, 0, 0});
      }
      const auto skip = static_cast<std::ptrdiff_t>(angle.size() - window);
      const HarmonicFit fit = fitHarmonic({angle.begin() + skip, angle.end()},
                                          {signals.begin() + 6 * skip, signals.end()}, {false});
      const Locus expected = locusFromFit(fit);
      const Locus found = sliding.locus();
      // rounding of window sums of 4e-6
      EXPECT_LT(std::abs(found.P - expected.P), 1e-19);
      EXPECT_LT(std::abs(found.N - expected.N), 1e-19);
      EXPECT_NEAR(found.sigma, expected.sigma, 1e-8 * expected.sigma);
      EXPECT_NEAR(found.inflation, expected.inflation, 1e-12);
      EXPECT_EQ(found.samples, window);
    }
  }
}

// all six signals and a drift, while the window fills and after
TEST(SlidingFit, IsTheFitOfItsWindowWithDrift) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 2e-7);
  constexpr std::size_t kWindow = 150;
  for (const bool drift : {false, true}) {
    SlidingFit<6> sliding(kWindow, drift);
    std::vector<double> angle, signals;
    for (std::size_t k = 0; k < 4 * kWindow + 41; ++k) {
      const double a = 0.154 * static_cast<double>(k) - 0.7;
      Vector6 x;
      for (int i = 0; i < 6; ++i) {
        x[i] = 1e-6 * (i + 1) * std::cos(a + i) + 1e-4 * i +
               1e-8 * (i - 2) * static_cast<double>(k) + noise(random);
      }
      ASSERT_TRUE(sliding.add(a, x));
      angle.push_back(a);
      signals.insert(signals.end(), x.data(), x.data() + 6);
      const std::size_t n = std::min(k + 1, kWindow);
      EXPECT_EQ(sliding.samples(), n);
      if (n < 60 || k % 23 != 0) continue;
      const auto skip = static_cast<std::ptrdiff_t>(angle.size() - n);
      const HarmonicFit expected =
          fitHarmonic({angle.begin() + skip, angle.end()},
                      {signals.begin() + 6 * skip, signals.end()}, {drift});
      const HarmonicFit found = sliding.fit();
      // rounding of window sums of 150 × 6e-4, through the inflation of a short window
      EXPECT_LT((found.phasor - expected.phasor).cwiseAbs().maxCoeff(), 1e-16);
      EXPECT_LT((found.offset - expected.offset).cwiseAbs().maxCoeff(), 1e-15);
      EXPECT_LT((found.noise - expected.noise).cwiseAbs().maxCoeff(),
                1e-6 * expected.noise.maxCoeff());
      EXPECT_LT((found.scatter - expected.scatter).cwiseAbs().maxCoeff(), 1e-12);
      EXPECT_NEAR(found.inflation, expected.inflation, 1e-11);
    }
  }
}

// the contact turns by 40°: settled within one window, to the last digit
TEST(SlidingLocus, SettlesWithinOneWindow) {
  constexpr std::size_t kWindow = 400;  // ten periods
  const double step = 2 * M_PI / 40;
  SlidingLocus sliding(kWindow);
  const Complex P(2e-6, 0), before = std::polar(1e-6, 0.3),
                            after = std::polar(1e-6, 0.3 + 80 * M_PI / 180);
  std::size_t settled = 0;
  for (std::size_t k = 0; k < 4 * kWindow; ++k) {
    const double a = step * static_cast<double>(k);
    const Complex z = motion(P, k < 2 * kWindow ? before : after, a);
    sliding.add(a, z.real(), z.imag());
    if (k < 2 * kWindow) continue;
    const double change = std::arg(sliding.locus().N / after) / 2;
    if (std::abs(change) < 0.1 * 40 * M_PI / 180 && settled == 0) settled = k + 1 - 2 * kWindow;
    if (k + 1 >= 3 * kWindow) {
      EXPECT_LT(std::abs(change), 1e-12) << k;
    }
  }
  EXPECT_LT(settled, 0.95 * kWindow);
  EXPECT_GT(settled, 0.5 * kWindow);
}

// ten million samples with an offset of a thousand amplitudes: the last window as good as the first
TEST(SlidingLocus, RoundingDoesNotPileUp) {
  constexpr std::size_t kWindow = 250;
  SlidingLocus sliding(kWindow);
  const Complex P(2e-6, 1e-6), N(-1e-6, 5e-7);
  const double step = 2 * M_PI / 25;
  for (std::size_t k = 0; k < 10'000'000; ++k) {
    const double a = step * static_cast<double>(k % 25);
    const Complex z = motion(P, N, a);
    sliding.add(a, z.real() + 2e-3, z.imag());
  }
  // rounding of one sample, 4e-19, over the root of the window
  EXPECT_LT(std::abs(sliding.locus().P - P), 4e-19);
  EXPECT_LT(std::abs(sliding.locus().N - N), 4e-19);
}

TEST(SlidingLocus, RefusesWhatCannotBeFitted) {
  EXPECT_THROW(SlidingLocus(7), InputError);
  SlidingLocus sliding(40);
  EXPECT_THROW(sliding.locus(), InputError);
  for (int k = 0; k < 20; ++k) sliding.add(2 * M_PI * k, 1e-6, 0);
  EXPECT_THROW(sliding.locus(), InputError);  // always the same angle
  sliding.reset();
  for (int k = 0; k < 60; ++k) sliding.add(0.3 * k, 1e-6 * std::cos(0.3 * k), 0);
  EXPECT_TRUE(sliding.full());
  EXPECT_FALSE(sliding.add(18, std::numeric_limits<double>::quiet_NaN(), 0));
  EXPECT_EQ(sliding.samples(), 0u);
  for (int k = 0; k < 60; ++k) sliding.add(0.3 * k, 1e-6 * std::cos(0.3 * k), 0);
  EXPECT_NEAR(sliding.locus().P.real(), 5e-7, 1e-18);
}

}  // namespace
}  // namespace assembly_cell
