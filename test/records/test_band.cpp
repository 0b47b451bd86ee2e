// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/band.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kStep = 1e-4;  // between samples [m]

Curve curveOf(double to, const std::function<double(double)>& axial) {
  Curve c;
  for (int i = 0; i * kStep <= to + 1e-9; ++i) {
    const double depth = i * kStep;
    c.time.push_back(0.01 * i);
    c.depth.push_back(depth);
    c.axial.push_back(axial(depth));
    c.lateral.push_back(0.0);
    c.moment.push_back(0.0);
    c.tilt.push_back(0.0);
  }
  return c;
}

// Not of the band's model: the level is log-normal, a ripple of random wavelength and phase, noise
// that is correlated along the path with heavy tails (t, 3 degrees of freedom).
Curve randomCurve(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::student_t_distribution<double> heavy(3.0);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const double level = 5.0 * std::exp(0.2 * normal(random)), phase = 6.3 * uniform(random);
  const double wave = 2e-3 + 4e-3 * uniform(random), end = 0.02 + 1e-5 * heavy(random);
  double noise = 0.0;
  return curveOf(end, [&](double depth) {
    noise = 0.9 * noise + 0.1 * heavy(random);
    return level * (1.0 + 20.0 * depth + 0.1 * std::sin(6.3 * depth / wave + phase)) + noise;
  });
}

std::vector<Curve> randomCurves(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < count; ++i) curves.push_back(randomCurve(random));
  return curves;
}

BandSettings settingsOf(double alpha) {
  BandSettings settings;
  settings.program = "plate";
  settings.alpha = alpha;
  settings.step = 1e-3;
  return settings;
}

std::string refusalOf(const std::vector<Curve>& good, const BandSettings& settings) {
  try {
    learnBand(good, settings);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// The rate of one learning set is Beta distributed; the mean over learning sets is
// k'/(n + 1) with k' = n + 1 − ⌈(n + 1)(1 − alpha)⌉: here exactly alpha. sd of a set's rate
// √(alpha (1 − alpha)/(n + 2)), of the mean of 60 sets of 200 curves with the counts' own.
TEST(Band, RateOfFalseAlarmsIsAlphaWhateverTheDistribution) {
  constexpr int kSets = 60, kTried = 200, kCalibrated = 19;
  constexpr double kAlpha = 0.1;
  int alarms = 0;
  for (int set = 0; set < kSets; ++set) {
    const std::uint64_t seed = 10 * static_cast<std::uint64_t>(set);
    const Band band = learnBand(randomCurves(2 * kCalibrated, seed), settingsOf(kAlpha));
    for (const Curve& curve : randomCurves(kTried, seed + 1)) {
      alarms += evaluateBand(band, curve).passed ? 0 : 1;
    }
  }
  const double rate = double(alarms) / (kSets * kTried);
  const double variance = kAlpha * (1.0 - kAlpha) / (kCalibrated + 2.0) / kSets +
                          kAlpha * (1.0 - kAlpha) / (kSets * kTried);
  EXPECT_NEAR(rate, kAlpha, 3.0 * std::sqrt(variance));
}

// With n scores and rank n, the alarm of another exchangeable curve has probability 1/(n + 1).
TEST(Band, LimitIsTheExactQuantileOfTheFiniteSample) {
  std::vector<Curve> good = randomCurves(198, 5);
  const Band band = learnBand(good, settingsOf(0.01));
  std::vector<double> scores;
  for (std::size_t i = 1; i < good.size(); i += 2) {
    scores.push_back(bandScore(band, good[i]).score);
  }
  EXPECT_EQ(scores.size(), 99u);
  EXPECT_EQ(band.limit, *std::max_element(scores.begin(), scores.end()));
  std::sort(scores.begin(), scores.end());
  EXPECT_EQ(learnBand(good, settingsOf(0.1)).limit, scores[89]);
}

TEST(Band, TooSmallARateIsRefusedWithTheNumberOfRunsItTakes) {
  const std::vector<Curve> good = randomCurves(50, 1);
  EXPECT_EQ(
      refusalOf(good, settingsOf(0.001)),
      "alpha: value 0.001: 50 good runs (25 of them to calibrate) support at least 0.0384615: "
      "give that, or 1998 good runs");
  EXPECT_EQ(refusalOf(good, settingsOf(1.0 / 26.0)), "");
  EXPECT_EQ(refusalOf(randomCurves(198, 1), settingsOf(0.01)), "");
  EXPECT_NE(refusalOf(randomCurves(197, 1), settingsOf(0.01)), "");
}

TEST(Band, ConstantCurvesHaveABand) {
  for (const double force : {0.0, 7.0}) {
    const std::vector<Curve> good(20, curveOf(0.01, [&](double) { return force; }));
    const Band band = learnBand(good, settingsOf(0.1));
    EXPECT_TRUE(evaluateBand(band, good[0]).passed);
    EXPECT_FALSE(evaluateBand(band, curveOf(0.01, [&](double) { return force + 1.0; })).passed);
  }
}

TEST(Band, VerdictNamesThePlaceWhereTheBandWasLeft) {
  const Band band = learnBand(randomCurves(198, 3), settingsOf(0.01));
  const Curve burr =
      curveOf(0.02, [](double d) { return d > 0.0119 && d < 0.014 ? 40.0 : 5.0 + 100.0 * d; });
  const RunVerdict verdict = evaluateBand(band, burr);
  EXPECT_FALSE(verdict.passed);
  EXPECT_LT(verdict.margin, 0.0);
  EXPECT_EQ(verdict.quantity, "axial");
  EXPECT_GE(verdict.depth, 0.0119);
  EXPECT_LE(verdict.depth, 0.0141);
  EXPECT_NE(verdict.text.find("axial 40 N at 1"), std::string::npos) << verdict.text;
  EXPECT_NEAR(verdict.margin, 1.0 - bandScore(band, burr).score / band.limit, 1e-15);
}

TEST(Band, EarlyEndIsFoundByTheEndsOwnSpread) {
  const Band band = learnBand(randomCurves(198, 3), settingsOf(0.01));
  const auto good = [](double d) { return 5.0 + 100.0 * d; };
  EXPECT_TRUE(evaluateBand(band, curveOf(0.02, good)).passed);
  const RunVerdict verdict = evaluateBand(band, curveOf(0.017, good));
  EXPECT_FALSE(verdict.passed);
  EXPECT_EQ(verdict.quantity, "end");
  EXPECT_EQ(verdict.text.substr(0, 36), "the curve's end at 17 mm is outside:");
}

TEST(Band, SamplesOfAPegThatIsPulledUpOrStuckCountWhereItHasComeTo) {
  const Band band = learnBand(randomCurves(198, 3), settingsOf(0.01));
  const Curve good = curveOf(0.02, [](double d) { return 5.0 + 100.0 * d; });
  Curve pulled = good, stuck = good;
  const auto insert = [&good](Curve& curve, std::size_t at, double up, double axial) {
    const auto put = [at](std::vector<double>& v, double x) {
      v.insert(v.begin() + static_cast<std::ptrdiff_t>(at), x);
    };
    put(curve.time, good.time[at]), put(curve.depth, good.depth[at - 1] - up);
    put(curve.axial, axial), put(curve.lateral, 0.0), put(curve.moment, 0.0), put(curve.tilt, 0.0);
  };
  insert(pulled, 100, 5e-3, 5.9);
  insert(stuck, 100, 0.0, 60.0);
  EXPECT_TRUE(evaluateBand(band, pulled).passed) << evaluateBand(band, pulled).text;
  const RunVerdict verdict = evaluateBand(band, stuck);
  EXPECT_FALSE(verdict.passed);
  EXPECT_NEAR(verdict.depth, 0.0099, 1e-9);
  insert(pulled, 100, 5e-3, -60.0);
  EXPECT_FALSE(evaluateBand(band, pulled).passed);
}

TEST(Band, NaNCountsAsOutsideAndTakesPartInTheQuantile) {
  std::vector<Curve> good = randomCurves(198, 3);
  const Band band = learnBand(good, settingsOf(0.02));
  Curve broken = good[0];
  broken.axial[50] = std::nan("");
  const RunVerdict verdict = evaluateBand(band, broken);
  EXPECT_FALSE(verdict.passed);
  EXPECT_TRUE(std::isnan(verdict.margin));
  EXPECT_EQ(verdict.text, "not evaluated, counts as outside: axial isn't a number at 5 mm");
  good[1] = broken;
  EXPECT_GE(learnBand(good, settingsOf(0.02)).limit, band.limit);
  EXPECT_EQ(
      refusalOf(good, settingsOf(0.01)),
      "band: 1 of the 99 runs to calibrate can't be evaluated (a value that isn't a number, or "
      "not all of the path): more than alpha 0.01 lets pass: leave them out if they aren't "
      "good, or give a shorter path from and to");
  broken.depth[7] = std::nan("");
  EXPECT_EQ(evaluateBand(band, broken).text,
            "not evaluated, counts as outside: depth of sample 7 isn't a number");
  EXPECT_FALSE(evaluateBand(band, Curve()).passed);
}

TEST(Band, OverTimeACurveThatDoesNotCoverTheBandIsOutside) {
  BandSettings settings = settingsOf(0.1);
  settings.over_time = true;
  settings.step = 0.1;
  std::vector<Curve> good = randomCurves(60, 3);
  for (Curve& curve : good) std::fill(curve.depth.begin(), curve.depth.end(), std::nan(""));
  settings.to = 1.5;
  const Band band = learnBand(good, settings);
  const Curve whole = curveOf(0.02, [](double d) { return 5.0 + 100.0 * d; });
  EXPECT_TRUE(evaluateBand(band, whole).passed);
  const Curve early = curveOf(0.01, [](double d) { return 5.0 + 100.0 * d; });
  EXPECT_EQ(evaluateBand(band, early).text,
            "not evaluated, counts as outside: the curve ends before the band");
}

TEST(Band, CurvesWithoutACommonPathAreRefused) {
  std::vector<Curve> good = randomCurves(60, 3);
  Curve& late = good[4];
  for (double& depth : late.depth) depth += 1.0;
  EXPECT_EQ(refusalOf(good, settingsOf(0.1)).substr(0, 12), "band: from 1");
  EXPECT_NE(refusalOf(good, settingsOf(0.1)).find("no path in common"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
