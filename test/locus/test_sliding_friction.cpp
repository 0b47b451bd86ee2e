// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Friction from the phase of a sliding peg: thesis chapter 9 in closed form, and the simulated
// cell.
#include "assembly_cell/locus/sliding_friction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "../../benchmark/support/simulated_reading.h"

namespace assembly_cell {
namespace {

// P = R e^{-if}, R = sqrt(F² - (μN)²)/|k - mω²|, f = atan2(μN, (k - mω²)R) (docs/theory/thesis.md,
// "Locus")
TEST(SlidingFriction, OfTheTextbookCircle) {
  for (const double k : {1e3, 1e5}) {
    const double m = 0.4, w = 300, F = 2.0, mu = 0.15, N = 5.0;
    const double stiff = k - m * w * w;
    const double R = std::sqrt(F * F - mu * mu * N * N) / std::abs(stiff);
    Locus locus;
    locus.P = std::polar(R, -std::atan2(mu * N, stiff * R));
    locus.sigma = 1e-2 * R;
    locus.samples = 400;
    const SlidingFriction f = slidingFriction(locus, F, N);
    EXPECT_NEAR(f.coefficient, mu, 1e-12);

    // and its sd
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0.0, std::sqrt(locus.variance()));
    double squares = 0.0;
    constexpr int kRuns = 4000;
    for (int run = 0; run < kRuns; ++run) {
      Locus noisy = locus;
      noisy.P += std::complex<double>(normal(random), normal(random));
      squares += std::pow(slidingFriction(noisy, F, N).coefficient - mu, 2) / kRuns;
    }
    EXPECT_NEAR(std::sqrt(squares) / f.sd, 1.0, 0.05);  // 4 standard errors
  }
}

// A peg that slides on the plane in the simulated cell, through its sensor: rocking, damping and a
// compliant carrier; the textbook's formula is off by factors here.
TEST(SlidingFriction, OfTheSimulatedCell) {
  for (const double mu : {0.1, 0.2, 0.35}) {
    for (const double frequency : {500.0, 770.0}) {
      SimulatedReadingOptions o;
      o.lean = 0.7;
      o.tilt = 0.02;
      o.offset = 0.03 * Eigen::Vector2d(std::cos(o.lean), std::sin(o.lean));
      o.frequency = frequency;
      o.amplitude = 15.0;
      o.direction = mu > 0.3 ? -1 : 1;
      o.press = 8.0;
      o.overrides = {"friction.static=" + std::to_string(mu),
                     "friction.sliding=" + std::to_string(mu)};
      const SimulatedReading r = readSimulated(o);
      const SlidingFriction f = slidingFriction(r.scenario.mechanism, r.point, r.fit);
      // the slip is no perfect circle and the press varies in a turn: harmonics that one circle
      // leaves out
      EXPECT_NEAR(f.coefficient, mu, 0.07 * mu) << frequency;
      EXPECT_LT(f.across, 0.1) << frequency;
    }
  }
}

// a contact that sticks opposes no slip: most of its force is across
TEST(SlidingFriction, AStickingContactIsNone) {
  SimulatedReadingOptions o;
  o.lean = 0.7;
  o.tilt = 0.04;
  o.offset = 0.03 * Eigen::Vector2d(std::cos(o.lean), std::sin(o.lean));
  const SimulatedReading r = readSimulated(o);
  const SlidingFriction f = slidingFriction(r.scenario.mechanism, r.point, r.fit);
  EXPECT_TRUE(f.across > 0.5 || f.coefficient < 0.02) << f.coefficient << " across " << f.across;
}

TEST(SlidingFriction, Refusals) {
  Locus locus;
  locus.P = 1e-6;
  locus.samples = 400;
  EXPECT_THROW(slidingFriction(locus, 1.0, 0.0), InputError);
  EXPECT_THROW(slidingFriction(locus, 1.0, std::nan("")), InputError);
  locus.P = 0;
  EXPECT_EQ(slidingFriction(locus, 1.0, 1.0).coefficient, 0.0);
  const Mechanism s =
      loadMechanism(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  OperatingPoint p;
  p.frequency = 770;
  p.amplitude = 1;
  HarmonicFit fit;
  fit.phasor.setZero();
  fit.samples = 100;
  EXPECT_THROW(slidingFriction(s, p, fit), InputError);  // no press
  p.press = 12;
  EXPECT_TRUE(std::isfinite(slidingFriction(s, p, fit).coefficient));
}

}  // namespace
}  // namespace assembly_cell
