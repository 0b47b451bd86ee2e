// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// C against C*: by vertical motion and yaw of the model and of the simulated cell, by a wobble
// against exact rotations.
#include "assembly_cell/locus/half_turn.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "../../benchmark/support/simulated_reading.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

OperatingPoint upright(double frequency) {
  OperatingPoint p;
  p.frequency = frequency;
  p.amplitude = 1.0;
  p.press = 12.0;
  return p;
}

double apart(double a, double b) { return std::abs(std::remainder(a - b, 2 * M_PI)); }

// the coupling's six displacements of a contact in direction alpha
HarmonicFit measuredFit(const ContactResponse& r, double noise) {
  HarmonicFit fit;
  fit.phasor = r.coupling;
  fit.samples = 1000;
  fit.noise = noise * noise * Matrix6::Identity();
  return fit;
}

TEST(HalfTurn, VerticalMotionAndYawTell) {
  const Scenario s = cell();
  for (const int direction : {1, -1}) {
    for (int k = 0; k < 12; ++k) {
      OperatingPoint p = upright(k % 2 ? 770 : 450);
      p.direction = direction;
      const double alpha = 0.5 * k + 0.1;
      const ContactResponse r = contactResponse(s.mechanism, p, alpha);
      const HarmonicFit fit = measuredFit(r, 1e-9);
      const Locus locus = centreOfMassLocus(s.mechanism, direction * p.frequency, fit);
      const DirectionEstimate plane = contactDirection(s.mechanism, p, locus, LocusAxes::kSensor);
      EXPECT_NEAR(plane.weight, 0.5, 1e-3);  // upright: the plane doesn't
      const HalfTurnEvidence all = halfTurnEvidence(s.mechanism, direction * p.frequency, fit);
      // each alone, and both
      for (const int use : {1, 2, 3}) {
        HalfTurnEvidence evidence;
        if (use & 1) evidence.vertical = all.vertical;
        if (use & 2) evidence.yaw = all.yaw;
        const DirectionEstimate e =
            resolveHalfTurn(s.mechanism, p, evidence, plane, LocusAxes::kSensor);
        EXPECT_LT(apart(e.alpha, alpha), 1e-3) << use;
        EXPECT_LT(apart(e.alpha_opposite, alpha + M_PI), 1e-3) << use;
        EXPECT_GT(e.weight, 0.999999) << use;
      }
      EXPECT_EQ(resolveHalfTurn(s.mechanism, p, {}, plane).weight, plane.weight);
    }
  }
}

// weights are probabilities: of what is called 80 to 95 %, that share is right
TEST(HalfTurn, WeightsAreCalibrated) {
  const Scenario s = cell();
  const OperatingPoint p = upright(770);
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> any(0, 2 * M_PI);
  int resolved = 0, right = 0;
  double expected = 0.0;
  for (int run = 0; run < 4000; ++run) {
    const double alpha = any(random);
    const HarmonicFit fit = measuredFit(contactResponse(s.mechanism, p, alpha), 0);
    HalfTurnEvidence evidence = halfTurnEvidence(s.mechanism, p.frequency, fit);
    evidence.yaw.reset();
    const double sd = 0.8 * std::abs(evidence.vertical->value);
    evidence.vertical->value += sd * std::complex<double>(normal(random), normal(random));
    evidence.vertical->variance = sd * sd;
    DirectionEstimate plane;
    plane.alpha = alpha;
    plane.alpha_opposite = alpha + M_PI;
    const DirectionEstimate e = resolveHalfTurn(s.mechanism, p, evidence, plane);
    if (e.weight < 0.8 || e.weight > 0.95) continue;
    ++resolved;
    expected += e.weight;
    right += apart(e.alpha, alpha) < 1.0;
  }
  ASSERT_GT(resolved, 300);
  // 4 standard deviations of a count, a weight that the model's 5 % make cautious
  EXPECT_NEAR(right, expected, 4 * std::sqrt(0.13 * resolved));
}

// The simulated cell, sensor noise of 16 bits at the exciter force of an alignment, tilts that the
// estimator does not know: never a wrong half turn.
TEST(HalfTurn, OfTheSimulatedCell) {
  for (const double tilt : {0.02, 0.07}) {
    for (const double lean : {0.2, 2.5, 4.4}) {
      for (const bool rim : {false, true}) {
        SimulatedReadingOptions o;
        o.lean = lean;
        o.tilt = tilt;
        o.amplitude = 1.0;
        o.bits = 16;
        o.noise = 0.5e-3;
        o.direction = lean > 3 ? -1 : 1;
        o.offset = rim ? Vector2d(-0.006 * Vector2d(std::cos(lean + 0.9), std::sin(lean + 0.9)))
                       : Vector2d(0.03 * Vector2d(std::cos(lean), std::sin(lean)));
        const SimulatedReading r = readSimulated(o);
        ASSERT_EQ(r.closed.size(), 1u);
        OperatingPoint blind = r.point;
        blind.tilt.setZero();
        blind.sensor_tilt.setZero();
        blind.rolling = false;
        const DirectionEstimate plane =
            contactDirection(r.scenario.mechanism, blind, r.locus, LocusAxes::kSensor);
        const DirectionEstimate e = resolveHalfTurn(
            r.scenario.mechanism, blind,
            halfTurnEvidence(r.scenario.mechanism, o.direction * o.frequency, r.fit), plane,
            LocusAxes::kSensor);
        EXPECT_LT(apart(e.alpha, r.contact), 0.3) << tilt << " " << lean << " " << rim;
        EXPECT_GT(e.weight, 0.99) << tilt << " " << lean << " " << rim;
      }
    }
  }
}

}  // namespace
}  // namespace assembly_cell
