// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The estimator's linear model against the simulated cell, which shares no code with it: nonlinear
// mechanism, contact law, friction, bridges, driver's static map, harmonic fit.
#include <gtest/gtest.h>

#include <cmath>

#include "../../benchmark/support/simulated_reading.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;

double degrees(double radians) { return std::abs(radians) * 180 / M_PI; }

// What the linear model leaves out: the law's lag in the contact (700 1/s), products of amplitude
// and tilt; where the contact sticks, as here.
constexpr double kMisfit = 0.005;
constexpr double kBias = 0.1;  // [deg]

SimulatedReadingOptions sticking() {
  SimulatedReadingOptions o;
  o.overrides = {"friction.static=0.5", "friction.sliding=0.5"};
  return o;
}

// leaning across the offset: the lowest point hangs over the hole, one edge crossing carries
TEST(LocusOfSimulation, SingleContactOfTwoEdges) {
  for (const double frequency : {500.0, 770.0}) {
    for (const int direction : {1, -1}) {
      for (const double tilt : {0.0262, 0.07}) {
        SimulatedReadingOptions o = sticking();
        o.lean = direction > 0 ? 3.34 : 4.91;
        o.tilt = tilt;
        o.offset = -0.006 * Vector2d(std::cos(o.lean + 0.9), std::sin(o.lean + 0.9));
        o.frequency = frequency;
        o.direction = direction;
        const SimulatedReading r = readSimulated(o);
        ASSERT_EQ(r.closed.size(), 1u);
        ASSERT_EQ(r.closed[0].feature, ContactFeature::kEdgeEdge);
        const DirectionEstimate e =
            contactDirection(r.scenario.mechanism, r.point, r.locus, LocusAxes::kSensor);
        // either half turn: how clearly they differ depends on where the tilt points
        EXPECT_LT(degrees(std::remainder(e.alpha - r.contact, M_PI)), kBias)
            << frequency << " " << direction << " " << tilt;
        EXPECT_LT(e.misfit, kMisfit);
      }
    }
  }
}

TEST(LocusOfSimulation, EdgeRollingOnThePlane) {
  for (const double frequency : {500.0, 770.0}) {
    for (const double tilt : {0.035, 0.14}) {
      SimulatedReadingOptions o = sticking();
      o.lean = 0.2;
      o.tilt = tilt;
      o.offset = 0.03 * Vector2d(std::cos(o.lean), std::sin(o.lean));
      o.frequency = frequency;
      SimulatedReading r = readSimulated(o);
      ASSERT_EQ(r.closed.size(), 1u);
      ASSERT_EQ(r.closed[0].feature, ContactFeature::kEdgePlane);
      const DirectionEstimate e =
          contactDirection(r.scenario.mechanism, r.point, r.locus, LocusAxes::kSensor);
      EXPECT_LT(degrees(std::remainder(e.alpha - r.contact, M_PI)), kBias)
          << frequency << " " << tilt;
      EXPECT_LT(e.misfit, kMisfit);
      // without rolling the model fits worse
      r.point.rolling = false;
      EXPECT_GT(contactDirection(r.scenario.mechanism, r.point, r.locus, LocusAxes::kSensor).misfit,
                e.misfit);
    }
  }
}

// Two contacts at once: no direction of a single one explains the locus.
TEST(LocusOfSimulation, DoubleContactIsRefusedByItsMisfit) {
  SimulatedReadingOptions o;
  o.lean = 1.0 + M_PI;
  o.tilt = 0.017;
  o.offset = {0.0032, 0.0050};
  o.frequency = 500;
  const SimulatedReading r = readSimulated(o);
  ASSERT_EQ(r.closed.size(), 2u);
  EXPECT_GT(contactDirection(r.scenario.mechanism, r.point, r.locus, LocusAxes::kSensor).misfit,
            0.2);
}

}  // namespace
}  // namespace assembly_cell
