// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/harmonic_fit.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

// samples of six signals at `per_period` samples a period
struct Samples {
  std::vector<double> angle, signals;
};

Samples sample(std::size_t n, double per_period, int direction,
               const std::function<double(int signal, double angle, double progress)>& signal) {
  Samples s;
  for (std::size_t k = 0; k < n; ++k) {
    const double a = direction * (2.0 * M_PI * (static_cast<double>(k) + 0.37) / per_period + 0.9);
    s.angle.push_back(a);
    for (int j = 0; j < 6; ++j) {
      s.signals.push_back(signal(j, a, static_cast<double>(k) / static_cast<double>(n - 1) - 0.5));
    }
  }
  return s;
}

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing thrown";
}

// Noiseless data lie in the model's span: what is left is rounding of about 1e-16 of the offset,
// which is up to 100 amplitudes.
TEST(HarmonicFit, ExactOnNoiselessDataWithOffsetAndDrift) {
  for (const int direction : {1, -1}) {
    for (const std::size_t n : {97u, 1000u, 1021u}) {
      const auto phasor = [](int j) { return std::polar(1e-6 * (1 + j), 0.3 + 1.1 * j); };
      const Samples s = sample(n, 40.7, direction, [&](int j, double a, double progress) {
        return (phasor(j) * std::polar(1.0, a)).real() + 1e-4 * (j - 2) + 3e-5 * progress;
      });
      const HarmonicFit fit = fitHarmonic(s.angle, s.signals);
      EXPECT_EQ(fit.samples, n);
      for (int j = 0; j < 6; ++j) {
        EXPECT_LT(std::abs(fit.phasor[j] - phasor(j)), 1e-12 * 1e-4) << j << " n " << n;
        EXPECT_NEAR(fit.offset[j], 1e-4 * (j - 2), 1e-12 * 1e-4);
        EXPECT_LT(fit.noise(j, j), 1e-30);
      }
    }
  }
}

// The exciter's sense decides which amplitude is P: a locus that turns with it has no N.
TEST(HarmonicFit, PTurnsWithTheExciter) {
  for (const int direction : {1, -1}) {
    const Samples s = sample(400, 40, direction, [](int j, double a, double) {
      return j == 0 ? std::cos(a) : j == 1 ? std::sin(a) : 0.0;
    });
    const HarmonicFit fit = fitHarmonic(s.angle, s.signals);
    const Locus locus = locusFromPhasors(fit.phasor[0], fit.phasor[1], 0, fit.samples, 1);
    EXPECT_LT(std::abs(locus.P - 1.0), 1e-14);
    EXPECT_LT(std::abs(locus.N), 1e-14);
    EXPECT_NEAR(locus.semiMinor(), 1.0, 1e-14);
  }
}

// docs/theory/thesis.md, "Locus": windows, to two decimals
TEST(HarmonicFit, InflationOfWindowsThatAreNotWholePeriods) {
  const auto inflation = [](double periods, bool drift) {
    const std::size_t n = 4000;
    const Samples s =
        sample(n, static_cast<double>(n) / periods, 1, [](int, double, double) { return 0.0; });
    return fitHarmonic(s.angle, s.signals, {drift}).inflation;
  };
  EXPECT_NEAR(inflation(1.5, false), 1.05, 0.006);
  EXPECT_NEAR(inflation(2.5, true), 1.02, 0.006);
  EXPECT_NEAR(inflation(1.0, true), 1.78, 0.02);
  EXPECT_NEAR(inflation(1.0, false), 1.0, 1e-12);
  EXPECT_NEAR(inflation(7.0, false), 1.0, 1e-12);
}

// The noise and the scatter of the estimates are those of the fit (chi-square and normal limits
// at four standard errors).
TEST(HarmonicFit, VarianceAndScatterAreAsStated) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr int kRuns = 400;
  double variance = 0.0, scatter = 0.0, inflation = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const Samples s = sample(
        100, 66.0, 1, [&](int, double a, double) { return std::cos(a) + 0.2 * normal(random); });
    const HarmonicFit fit = fitHarmonic(s.angle, s.signals);
    inflation = fit.inflation;
    for (int j = 0; j < 6; ++j) {
      variance += fit.noise(j, j) / (6.0 * kRuns);
      scatter += std::norm(fit.phasor[j] - 1.0) / (6.0 * kRuns);
    }
  }
  // 6·400 estimates with 96 degrees of freedom each; |error|² is a sum of two squares
  EXPECT_NEAR(variance / 0.04, 1.0, 4.0 * std::sqrt(2.0 / (2400.0 * 96.0)));
  EXPECT_NEAR(scatter / (4.0 * 0.04 / 100.0 * inflation), 1.0, 4.0 / std::sqrt(2400.0));
}

// docs/theory/thesis.md, "Locus": bound of the orientation [deg], n = 400; and the least-squares
// fit attains it (2 % is four standard errors of 20000 runs' rms, with the second-order excess of
// the noisiest row allowed for).
TEST(HarmonicFit, OrientationAttainsTheCramerRaoBound) {
  struct Row {
    double b, sigma, bound;
  };
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  for (const Row& row : {Row{0.4, 0.02, 0.104}, Row{0.4, 0.1, 0.519}, Row{0.4, 0.3, 1.56},
                         Row{0.8, 0.1, 1.44}, Row{-0.4, 0.3, 1.56}}) {
    Locus ground_truth;
    ground_truth.P = 0.5 * (1.0 + row.b) * std::polar(1.0, 0.3);
    ground_truth.N = 0.5 * (1.0 - row.b) * std::polar(1.0, 1.1);
    ground_truth.sigma = row.sigma;
    ground_truth.samples = 400;
    EXPECT_NEAR(ground_truth.orientationSd() * 180 / M_PI, row.bound, 0.006 * row.bound);
    EXPECT_NEAR(ground_truth.orientation(), 0.7, 1e-14);
    EXPECT_NEAR(ground_truth.semiMajor(), 1.0, 1e-14);
    EXPECT_NEAR(ground_truth.semiMinor(), row.b, 1e-14);

    const double sd = row.sigma / 20.0;
    constexpr int kRuns = 20000;
    double sum = 0.0;
    for (int run = 0; run < kRuns; ++run) {
      Locus noisy = ground_truth;
      noisy.P += sd * Complex(normal(random), normal(random));
      noisy.N += sd * Complex(normal(random), normal(random));
      const double error = std::remainder(noisy.orientation() - 0.7, M_PI);
      sum += error * error;
    }
    EXPECT_NEAR(std::sqrt(sum / kRuns) / ground_truth.orientationSd(), 1.0, 0.02 + 0.1 * row.sigma);
  }
}

TEST(HarmonicFit, OrientationOfACircleIsUndefined) {
  Locus circle;
  circle.P = 1.0;
  circle.sigma = 0.1;
  circle.samples = 100;
  EXPECT_TRUE(std::isnan(circle.orientation()));
  EXPECT_TRUE(std::isinf(circle.orientationSd()));
}

TEST(HarmonicFit, RefusesBadInput) {
  const auto zero = [](int, double, double) { return 0.0; };
  Samples s = sample(100, 20, 1, zero);
  s.signals.pop_back();
  EXPECT_EQ(messageOf([&] { fitHarmonic(s.angle, s.signals); }),
            "signals have 599 values for 100 samples: six a sample are needed");
  s = sample(7, 3, 1, zero);
  EXPECT_EQ(messageOf([&] { fitHarmonic(s.angle, s.signals); }),
            "window has 7 samples: at least 8 are needed");
  s = sample(100, 130, 1, zero);
  EXPECT_NE(messageOf([&] { fitHarmonic(s.angle, s.signals); }).find("at least one is needed"),
            std::string::npos);
  s = sample(100, 1.5, 1, zero);
  EXPECT_NE(messageOf([&] { fitHarmonic(s.angle, s.signals); }).find("more than two are needed"),
            std::string::npos);
  s = sample(100, 20, -1, zero);
  s.signals[6 * 31 + 4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(messageOf([&] { fitHarmonic(s.angle, s.signals); }),
            "signal 4 of sample 31 is not finite: leave the sample out");
  s = sample(100, 20, 1, zero);
  s.angle[99] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(messageOf([&] { fitHarmonic(s.angle, s.signals); }),
            "exciter angle of sample 99 is not finite: leave the sample out");
}

// ---- modes ----

Locus locusOf(double a, double b, double sigma, std::size_t n) {
  Locus locus;
  locus.P = 0.5 * (a + b) * std::polar(1.0, 0.4);
  locus.N = 0.5 * (a - b) * std::polar(1.0, -1.3);
  locus.sigma = sigma;
  locus.samples = n;
  return locus;
}

// P, N and the noise as a fit of n samples finds them
Locus measured(const Locus& ground_truth, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double nu = 2.0 * static_cast<double>(ground_truth.samples) - 8.0;
  std::chi_squared_distribution<double> chi2(nu);
  Locus locus = ground_truth;
  const double sd = std::sqrt(ground_truth.variance());
  locus.P += sd * Complex(normal(random), normal(random));
  locus.N += sd * Complex(normal(random), normal(random));
  locus.sigma = ground_truth.sigma * std::sqrt(chi2(random) / nu);
  return locus;
}

// docs/theory/thesis.md, "Locus": critical values at 394 degrees of freedom, four digits
TEST(LocusMode, CriticalValuesOfTheFTests) {
  constexpr std::size_t kN = 201;  // 2 n - 8 = 394
  struct Row {
    double false_alarm, f0, fc, fl;
  };
  for (const Row& row : {Row{0.01, 3.367, 4.659, 6.700}, Row{0.001, 4.714, 7.030, 10.99}}) {
    const auto mode = [&](double p, double n) {
      Locus locus;
      locus.P = std::sqrt(p / kN);
      locus.N = std::sqrt(n / kN);
      locus.sigma = 1.0;
      locus.samples = kN;
      return decideMode(locus, row.false_alarm, 0.0).mode;
    };
    EXPECT_EQ(mode(4 * 0.999 * row.f0 / 2, 4 * 0.999 * row.f0 / 2), LocusMode::kNone);
    EXPECT_NE(mode(4 * 1.001 * row.f0 / 2, 4 * 1.001 * row.f0 / 2), LocusMode::kNone);
    EXPECT_EQ(mode(1e4, 2 * 0.999 * row.fc), LocusMode::kCircle);
    EXPECT_EQ(mode(1e4, 2 * 1.001 * row.fc), LocusMode::kEllipse);
    const auto squared = [](double v) { return v * v; };
    EXPECT_EQ(mode(1e4, squared(100 + std::sqrt(2 * 0.999 * row.fl))), LocusMode::kSegment);
    EXPECT_EQ(mode(1e4, squared(100 + std::sqrt(2 * 1.001 * row.fl))), LocusMode::kEllipse);
  }
}

// docs/theory/thesis.md, "Locus": confusion at n = 200, false alarm 1 %, exact tests; 2000 runs
// here and there: four standard errors of the difference, plus the table's rounding.
TEST(LocusMode, ConfusionTable) {
  struct Row {
    double a, b, sigma;
    double none, segment, circle, ellipse, undecided;
  };
  std::mt19937_64 random(3);
  for (const Row& row : {Row{0, 0, 1, .99, 0, 0, 0, .01}, Row{1, 0, .2, 0, .99, 0, .01, 0},
                         Row{1, 0, 1, 0, .99, 0, .01, 0}, Row{1, 0, 2, .04, .74, .01, .01, .21},
                         Row{1, 1, 1, 0, 0, .99, .01, 0}, Row{1, 1, 2, 0, 0, .96, 0, .03},
                         Row{1, .5, .2, 0, 0, 0, 1, 0}, Row{1, .5, 1, 0, .01, .26, .73, 0},
                         Row{1, .5, 2, .01, .14, .40, .01, .45}, Row{1, .2, .5, 0, .07, 0, .93, 0},
                         Row{1, .2, 1, 0, .72, .01, .28, 0}, Row{1, .2, 2, .04, .48, .04, 0, .44},
                         Row{1, -.5, 1, 0, .01, 0, .99, 0}, Row{1, -.5, 2, .01, .57, 0, .42, 0}}) {
    constexpr int kRuns = 2000;
    std::array<int, 5> count{};
    for (int run = 0; run < kRuns; ++run) {
      const Locus locus = measured(locusOf(row.a, row.b, row.sigma, 200), random);
      ++count[static_cast<std::size_t>(decideMode(locus, 0.01, 0.0).mode)];
    }
    const std::array<double, 5> table = {row.none, row.segment, row.ellipse, row.circle,
                                         row.undecided};
    for (std::size_t m = 0; m < 5; ++m) {
      const double p = std::clamp(table[m], 0.0025, 0.9975);
      EXPECT_NEAR(static_cast<double>(count[m]) / kRuns, table[m],
                  4.0 * std::sqrt(2.0 * p * (1.0 - p) / kRuns) + 0.005)
          << toString(static_cast<LocusMode>(m)) << " of a " << row.a << " b " << row.b << " sigma "
          << row.sigma;
    }
  }
}

// At good signal a true mode is refused at the stated rate: binomial, four standard errors.
TEST(LocusMode, FalseAlarmRateIsAsStated) {
  std::mt19937_64 random(5);
  constexpr int kRuns = 8000;
  for (const double rate : {0.01, 0.05}) {
    struct Truth {
      double a, b;
      LocusMode mode;
    };
    for (const Truth& ground_truth :
         {Truth{0, 0, LocusMode::kNone}, Truth{1, 0, LocusMode::kSegment},
          Truth{1, 1, LocusMode::kCircle}}) {
      int refused = 0;
      for (int run = 0; run < kRuns; ++run) {
        const Locus locus = measured(locusOf(ground_truth.a, ground_truth.b, 0.1, 200), random);
        refused += decideMode(locus, rate, 0.0).mode != ground_truth.mode;
      }
      EXPECT_NEAR(static_cast<double>(refused) / kRuns, rate,
                  4.0 * std::sqrt(rate * (1.0 - rate) / kRuns))
          << toString(ground_truth.mode);
    }
  }
}

// On the border of the indifference zone a mode is refused at about the stated rate, however large
// the signal; inside hardly ever; outside by a third of the zone's width nearly always.
TEST(LocusMode, IndifferenceZoneHoldsAtAnySignal) {
  std::mt19937_64 random(9);
  constexpr double kEps = 0.05;
  constexpr int kRuns = 3000;
  for (const double sigma : {0.1, 0.01, 0.001, 1e-5}) {
    const auto rate = [&](const Locus& ground_truth, LocusMode mode) {
      int refused = 0;
      for (int run = 0; run < kRuns; ++run) {
        refused += decideMode(measured(ground_truth, random), 0.01, kEps).mode != mode;
      }
      return static_cast<double>(refused) / kRuns;
    };
    // λ comes from the measured size and noise, which costs up to a factor of two in the rate
    const double limit = 2 * 0.01 + 4.0 * std::sqrt(0.02 / kRuns);
    EXPECT_LT(rate(locusOf(1, kEps, sigma, 200), LocusMode::kSegment), limit) << sigma;
    EXPECT_LT(rate(locusOf(1 + kEps, 1 - kEps, sigma, 200), LocusMode::kCircle), limit) << sigma;
    EXPECT_LT(rate(locusOf(1, 0.5 * kEps, sigma, 200), LocusMode::kSegment), 0.01) << sigma;
    if (sigma < 0.05) {
      EXPECT_GT(rate(locusOf(1, 2 * kEps, sigma, 200), LocusMode::kSegment), 0.99) << sigma;
      EXPECT_GT(rate(locusOf(1 + 2 * kEps, 1 - 2 * kEps, sigma, 200), LocusMode::kCircle), 0.99)
          << sigma;
    }
  }
}

TEST(LocusMode, ProbabilitiesSumToOneAndFollowTheMode) {
  std::mt19937_64 random(13);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0), power(-3.0, 1.0);
  for (int run = 0; run < 3000; ++run) {
    const Locus locus =
        measured(locusOf(1.0, uniform(random), std::pow(10.0, power(random)), 200), random);
    const ModeDecision d = decideMode(locus);
    EXPECT_NEAR(std::accumulate(d.probabilities.begin(), d.probabilities.end(), 0.0), 1.0, 1e-12);
    for (const double p : d.probabilities) {
      EXPECT_GE(p, 0.0);
    }
    if (d.mode == LocusMode::kUndecided) {
      EXPECT_EQ(d.probabilities[4], 0.5);
    }
    // undecided or the mode itself is the likeliest
    const auto best = std::max_element(d.probabilities.begin(), d.probabilities.end());
    const auto index = static_cast<std::size_t>(best - d.probabilities.begin());
    EXPECT_TRUE(index == static_cast<std::size_t>(d.mode) || d.probabilities[4] == 0.5);
  }
  // clear cases are near certain
  EXPECT_GT(decideMode(locusOf(1, 0.0, 0.01, 400)).probabilities[1], 0.9);
  EXPECT_GT(decideMode(locusOf(1, 0.5, 0.01, 400)).probabilities[2], 0.999);
  EXPECT_GT(decideMode(locusOf(1, -1, 0.01, 400)).probabilities[2], 0.999);
  EXPECT_GT(decideMode(locusOf(1, 1, 0.01, 400)).probabilities[3], 0.9);
}

TEST(LocusMode, NoiselessAndEmptyLociAreDecided) {
  EXPECT_EQ(decideMode(locusOf(0, 0, 0, 100)).mode, LocusMode::kNone);
  EXPECT_EQ(decideMode(locusOf(0, 0, 0.1, 100)).mode, LocusMode::kNone);
  EXPECT_EQ(decideMode(locusOf(1, 0, 0, 100)).mode, LocusMode::kSegment);
  EXPECT_EQ(decideMode(locusOf(1, 1, 0, 100)).mode, LocusMode::kCircle);
  EXPECT_EQ(decideMode(locusOf(1, 0.3, 0, 100)).mode, LocusMode::kEllipse);
  for (const double sigma : {0.0, 1e-300, 1e300}) {
    for (const double p : decideMode(locusOf(1, 0.3, sigma, 100)).probabilities) {
      EXPECT_TRUE(std::isfinite(p)) << sigma;
    }
  }
}

TEST(LocusMode, RefusesBadInput) {
  const Locus locus = locusOf(1, 0, 0.1, 100);
  EXPECT_THROW(decideMode(locus, 0.0), InputError);
  EXPECT_THROW(decideMode(locus, 0.5), InputError);
  EXPECT_THROW(decideMode(locus, 0.01, -0.1), InputError);
  EXPECT_THROW(decideMode(locusOf(1, 0, 0.1, 7)), InputError);
}

}  // namespace
}  // namespace assembly_cell
