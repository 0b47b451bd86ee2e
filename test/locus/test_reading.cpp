// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Locus measurement of motions with known ground truth, and its advice.
#include "assembly_cell/locus/reading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "../../benchmark/support/simulated_reading.h"

namespace assembly_cell {
namespace {

Mechanism cellMechanism() {
  return loadMechanism(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
}

struct ReadingSamples {
  std::vector<double> angle, signals;
};

// 0.2 s at 5 kHz of a deflection, with a press of 12 N and noise
ReadingSamples samplesOf(const Mechanism& m, const ExciterParameters& exciter,
                         const Eigen::Matrix<std::complex<double>, 6, 1>& phasor, double noise) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  ReadingSamples s;
  for (int k = 0; k < 1000; ++k) {
    const double a = exciter.direction * exciter.frequency * 2e-4 * k;
    s.angle.push_back(a);
    for (int j = 0; j < 6; ++j) {
      const double press = j == 2 ? (12.0 - m.peg.mass * m.gravity) / 5e4 : 0.0;
      s.signals.push_back((phasor[j] * std::polar(1.0, a)).real() + press + noise * normal(random));
    }
  }
  return s;
}

ContactResponse response(const Mechanism& m, const ExciterParameters& exciter, double alpha) {
  OperatingPoint p;
  p.frequency = exciter.frequency;
  p.amplitude = exciter.amplitude;
  p.direction = exciter.direction;
  p.press = 12.0;
  return contactResponse(m, p, alpha);
}

LocusReading readOf(const Mechanism& m, const ExciterParameters& exciter, const ReadingSamples& s) {
  return readLocus(m, exciter, s.angle, s.signals);
}

TEST(Reading, OneContactHasItsDirectionAndTheEndOfTheDiameter) {
  const Mechanism m = cellMechanism();
  for (const int direction : {1, -1}) {
    const ExciterParameters exciter{1.0, 770.0, 0.0, direction};
    for (double alpha = 0.3; alpha < 6.3; alpha += 1.0) {
      const LocusReading r =
          readOf(m, exciter, samplesOf(m, exciter, response(m, exciter, alpha).coupling, 1e-8));
      ASSERT_TRUE(r.direction) << alpha;
      EXPECT_NEAR(std::remainder(r.direction->alpha - alpha, 2 * M_PI), 0.0, 0.02);
      EXPECT_GT(r.direction->weight, ReadingLimits{}.half_turn);
      EXPECT_NEAR(r.force.z(), 12.0, 1e-3);
      EXPECT_FALSE(r.friction);
      EXPECT_EQ(r.advice, ReadingAdvice::kNone);
      EXPECT_EQ(r.refusal, "");
    }
  }
}

TEST(Reading, NothingMovesIsNoDirectionAndNoAdvice) {
  const Mechanism m = cellMechanism();
  const ExciterParameters exciter{1.0, 450.0, 0.0, 1};
  const LocusReading r = readOf(
      m, exciter, samplesOf(m, exciter, Eigen::Matrix<std::complex<double>, 6, 1>::Zero(), 1e-8));
  EXPECT_EQ(r.mode.mode, LocusMode::kNone);
  EXPECT_FALSE(r.direction);
  EXPECT_EQ(r.advice, ReadingAdvice::kNone);
}

TEST(Reading, ASlidingPegHasItsFrictionAndIsToBePressedMore) {
  SimulatedReadingOptions o;
  o.lean = 0.7;
  o.offset = 0.03 * Eigen::Vector2d(std::cos(o.lean), std::sin(o.lean));
  o.frequency = 500;
  o.amplitude = 15;
  o.press = 8;
  const SimulatedReading slide = readSimulated(o);
  MeasuredMotion motion;
  motion.fit = slide.fit;
  const LocusReading r =
      readLocus(slide.scenario.mechanism, {o.amplitude, o.frequency, 0.0, o.direction}, motion);
  EXPECT_FALSE(r.direction);
  ASSERT_TRUE(r.friction);
  EXPECT_NEAR(r.friction->coefficient, 0.2, 0.02);  // without the tilt: a tenth
  EXPECT_EQ(r.advice, ReadingAdvice::kPressMore);
}

TEST(Reading, NoiseThatHidesTheDirectionNeedsALongerWindow) {
  const Mechanism m = cellMechanism();
  const ExciterParameters exciter{1.0, 770.0, 0.0, 1};
  const LocusReading r =
      readOf(m, exciter, samplesOf(m, exciter, response(m, exciter, 1.0).coupling, 3e-5));
  EXPECT_EQ(r.refusal.rfind("too_uncertain", 0), 0u) << r.refusal;
  EXPECT_EQ(r.advice, ReadingAdvice::kReadLonger);
}

// At 500 rad/s this mechanism's single contact is all but a segment.
TEST(Reading, NamesAFrequencyWhereOneContactDoesNotLookLikeTwo) {
  const Mechanism m = cellMechanism();
  const ExciterParameters exciter{1.0, 500.0, 0.0, 1};
  const LocusReading r =
      readOf(m, exciter, samplesOf(m, exciter, response(m, exciter, 1.0).coupling, 1e-8));
  EXPECT_EQ(r.mode.mode, LocusMode::kSegment);
  ASSERT_GT(r.better_frequency, 0.0);
  const ExciterParameters better{1.0, r.better_frequency, 0.0, 1};
  const LocusReading again =
      readOf(m, better, samplesOf(m, better, response(m, better, 1.0).coupling, 1e-8));
  EXPECT_EQ(again.mode.mode, LocusMode::kEllipse);
  EXPECT_EQ(again.better_frequency, 0.0);
}

TEST(Reading, AnExciterThatIsOffLeavesTheModeAlone) {
  const Mechanism m = cellMechanism();
  const ExciterParameters exciter{1.0, 450.0, 0.0, 1};
  const ReadingSamples s = samplesOf(m, exciter, response(m, exciter, 1.0).coupling, 1e-8);
  const LocusReading r = readOf(m, {0.0, 450.0, 0.0, 1}, s);
  EXPECT_EQ(r.mode.mode, readOf(m, exciter, s).mode.mode);
  EXPECT_FALSE(r.direction);
  EXPECT_FALSE(r.friction);
  EXPECT_EQ(r.advice, ReadingAdvice::kNone);
}

}  // namespace
}  // namespace assembly_cell
