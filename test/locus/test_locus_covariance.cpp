// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Covariances of amplitudes and ellipse, and fits of samples of unequal noise, by Monte Carlo.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/harmonic_fit.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix4d;
using Eigen::Vector4d;

const Complex kP = std::polar(0.7, 0.3), kN = std::polar(0.3, 1.1);

Vector4d ellipseOf(Complex P, Complex N) {
  return {std::abs(P) + std::abs(N), std::abs(P) - std::abs(N), (std::arg(P) + std::arg(N)) / 2,
          (std::arg(P) - std::arg(N)) / 2};
}

// n samples, `step` apart, of noise sigma_x, sigma_y times scale_k
HarmonicFit fitted(std::size_t n, double step, double sigma_x, double sigma_y,
                   const std::vector<double>& scale, bool weighted, std::mt19937_64& random,
                   double correlation = 0.0) {
  const double rest = std::sqrt(1 - correlation * correlation);
  std::normal_distribution<double> normal;
  std::vector<double> angle, signals;
  for (std::size_t k = 0; k < n; ++k) {
    const double a = step * static_cast<double>(k) + 0.2;
    const Complex z = kP * std::polar(1.0, a) + kN * std::polar(1.0, -a);
    const double one = normal(random), other = normal(random);
    const double x = z.real() + sigma_x * scale[k] * one;
    const double y = z.imag() + sigma_y * scale[k] * (correlation * one + rest * other);
    angle.push_back(a);
    signals.insert(signals.end(), {x, y, 0, 0, 0, 0});
  }
  return fitHarmonic(angle, signals, {false}, weighted ? scale : std::vector<double>{});
}

// 1.3 periods, twice the noise along y, correlated with that along x: amplitudes are correlated,
// and stated so
TEST(LocusCovariance, IsTheScatterOfManyFits) {
  std::mt19937_64 random(2);
  constexpr int kRuns = 20000;
  constexpr std::size_t n = 130;
  const std::vector<double> one(n, 1.0);
  Matrix4d amplitudes = Matrix4d::Zero(), ellipse = Matrix4d::Zero(), stated = Matrix4d::Zero(),
           stated_ellipse = Matrix4d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    const HarmonicFit fit = fitted(n, 2 * M_PI / 100, 0.02, 0.04, one, false, random, 0.6);
    const Locus l = locusFromPhasors(fit.phasor[0], fit.phasor[1], 1, n, 1);
    const Vector4d d(l.P.real() - kP.real(), l.P.imag() - kP.imag(), l.N.real() - kN.real(),
                     l.N.imag() - kN.imag());
    const Vector4d e = ellipseOf(l.P, l.N) - ellipseOf(kP, kN);
    const LocusCovariance covariance = locusCovariance(fit);
    amplitudes += d * d.transpose() / kRuns;
    ellipse += e * e.transpose() / kRuns;
    stated += covariance.amplitudes / kRuns;
    stated_ellipse += covariance.ellipse / kRuns;
  }
  // 5 standard errors of a covariance, and second order in the noise, below 1 %
  const auto expectClose = [](const Matrix4d& found, const Matrix4d& expected) {
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const double scale = std::sqrt(expected(i, i) * expected(j, j));
        EXPECT_NEAR(found(i, j), expected(i, j), 5 * scale * std::sqrt(2.0 / kRuns) + 0.01 * scale)
            << i << j;
      }
    }
  };
  expectClose(amplitudes, stated);
  expectClose(ellipse, stated_ellipse);
  EXPECT_GT(stated.cwiseAbs()(0, 2), 0.1 * stated(0, 0));
  EXPECT_GT(stated.cwiseAbs()(0, 3), 0.1 * stated(0, 0));
}

// over whole periods: σ²/n of each amplitude, 2σ²/n of the axes, the orientation's known formula
TEST(LocusCovariance, WholePeriods) {
  std::mt19937_64 random(3);
  constexpr std::size_t n = 400;
  const HarmonicFit fit =
      fitted(n, 2 * M_PI / 40, 0.05, 0.05, std::vector<double>(n, 1.0), false, random);
  const Locus l = locusFromFit(fit);
  const LocusCovariance c = locusCovariance(fit);
  EXPECT_NEAR(c.amplitudes.trace() / 4, l.variance(), 1e-9 * l.variance());
  EXPECT_NEAR(std::sqrt(c.ellipse(2, 2)), l.orientationSd(), 0.1 * l.orientationSd());
  EXPECT_NEAR(c.ellipse(0, 0) + c.ellipse(1, 1), 4 * l.variance(), 1e-9 * l.variance());
}

// a third of the samples ten times as noisy: the weighted fit attains 1/Σ(1/σ²)
TEST(LocusCovariance, UncertaintyOfEachSample) {
  std::mt19937_64 random(4);
  constexpr int kRuns = 4000;
  constexpr std::size_t n = 400;
  std::vector<double> scale(n, 1.0);
  double information = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    if (k % 3 == 0) scale[k] = 10.0;
    information += std::pow(0.01 * scale[k], -2);
  }
  double weighted = 0.0, plain = 0.0, stated = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const auto squares = [&](const HarmonicFit& fit) {
      const Locus l = locusFromPhasors(fit.phasor[0], fit.phasor[1], 1, n, 1);
      return (std::norm(l.P - kP) + std::norm(l.N - kN)) / 4 / kRuns;
    };
    const HarmonicFit fit = fitted(n, 2 * M_PI / 40, 0.01, 0.01, scale, true, random);
    weighted += squares(fit);
    stated += locusCovariance(fit).amplitudes.trace() / 4 / kRuns;
    plain += squares(fitted(n, 2 * M_PI / 40, 0.01, 0.01, scale, false, random));
  }
  // 4 standard errors of a mean square of 4 × 4000 normals; columns that the weights couple, 1 %
  EXPECT_NEAR(weighted * information, 1, 0.05);
  EXPECT_NEAR(stated / weighted, 1, 0.05);
  EXPECT_GT(plain, 10 * weighted);
}

TEST(LocusCovariance, EqualUncertaintiesChangeNothing) {
  std::mt19937_64 one(5), other(5);
  const std::vector<double> scale(100, 1.0);
  const HarmonicFit a = fitted(100, 0.2, 0.01, 0.01, scale, true, one);
  const HarmonicFit b = fitted(100, 0.2, 0.01, 0.01, scale, false, other);
  EXPECT_LT((a.phasor - b.phasor).norm(), 1e-14);
  EXPECT_LT((a.noise - b.noise).norm(), 1e-16);
}

TEST(LocusCovariance, Refusals) {
  std::vector<double> angle, signals;
  for (int k = 0; k < 100; ++k) {
    angle.push_back(0.2 * k);
    signals.insert(signals.end(), {std::cos(0.2 * k), 0, 0, 0, 0, 0});
  }
  std::vector<double> sd(100, 1e-3);
  EXPECT_NO_THROW(fitHarmonic(angle, signals, {}, sd));
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    sd[7] = bad;
    EXPECT_THROW(fitHarmonic(angle, signals, {}, sd), InputError) << bad;
  }
  sd.pop_back();
  EXPECT_THROW(fitHarmonic(angle, signals, {}, sd), InputError);
  // a line has no phase of its own rotating part: not a number, not infinite loops
  const HarmonicFit flat{};
  EXPECT_TRUE(std::isnan(locusCovariance(flat).ellipse(2, 2)));
}

}  // namespace
}  // namespace assembly_cell
