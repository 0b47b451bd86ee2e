// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/contact_formulas.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

using namespace assembly_cell;
using Complex = std::complex<double>;
using Long = std::complex<long double>;

namespace {

constexpr double kFormulaPeg = 0.025, kFormulaHole = 0.02505;

double angleError(double a, double b) { return std::abs(std::remainder(a - b, 2 * M_PI)); }

// Both crossings of the projected edge of a peg tilted by q with the rim of a hole at `centre`, by
// bisection in long double: the directions of its edge contacts, first the one behind the hole's
// direction.
void crossings(Complex q, Complex centre, double& behind, double& ahead) {
  const long double toward = std::arg(Long(centre));
  const auto outside = [&](long double a) {
    // a point of the edge, tilted about the horizontal axis across q
    const long double low = q == 0.0 ? 0.0L : std::arg(Long(q));
    const long double shrink = std::cos(static_cast<long double>(std::abs(q)));
    // edge parameter whose projection lies in direction a
    const long double s = std::atan2(shrink * std::sin(a - low), std::cos(a - low));
    const Long local(shrink * std::cos(s), std::sin(s));
    const Long p = static_cast<long double>(kFormulaPeg) * local * std::polar(1.0L, low);
    return std::abs(p - Long(centre)) > static_cast<long double>(kFormulaHole);
  };
  const auto find = [&](long double sign) {
    long double in = 0.0L, out = static_cast<long double>(M_PI);
    for (int i = 0; i < 80; ++i) {
      const long double half = 0.5L * (in + out);
      (outside(toward + sign * half) ? out : in) = half;
    }
    return static_cast<double>(toward + sign * in);
  };
  behind = find(-1.0L);
  ahead = find(1.0L);
}

}  // namespace

// A rotation about a horizontal axis by s turns the lowest point as q says: against the rotation
// vector's own cross product.
TEST(ContactFormulas, ComplexTiltPointsDown) {
  for (const double a : {0.3, 2.0, -1.2}) {
    const Eigen::Vector2d tilt(0.01 * std::cos(a), 0.01 * std::sin(a));
    const Complex q = tiltAsComplex(tilt);
    EXPECT_NEAR(std::abs(q), 0.01, 1e-16);
    // height of the edge point in direction b: (tilt × e(b))_z
    const auto height = [&](double b) { return tilt.x() * std::sin(b) - tilt.y() * std::cos(b); };
    EXPECT_NEAR(height(std::arg(q)), -0.01, 1e-16);
    EXPECT_LT((tiltFromComplex(q) - tilt).norm(), 1e-16);
  }
}

// 7.1 is exact: 1e-13 of the tilt over sin of the wobble's angle, whatever half turn is read
TEST(ContactFormulas, WobbleTellsTheTilt) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 1000; ++i) {
    const Complex q(0.1 * uniform(engine), 0.1 * uniform(engine));
    const Complex dq(0.1 * uniform(engine), 0.1 * uniform(engine));
    const double a0 = std::arg(q) + (i % 2 ? M_PI : 0.0);
    const double a1 = std::arg(q + dq) - (i % 3 ? M_PI : 0.0);
    const double sine = std::abs(std::sin(a1 - a0));
    const auto found = tiltFromWobble(dq, a0, a1);
    ASSERT_TRUE(found);
    EXPECT_LT(std::abs(*found - q), 1e-15 / sine / sine) << i;
  }
  // along the tilt nothing can be told
  EXPECT_FALSE(tiltFromWobble({0.01, 0.0}, 0.0, 0.0));
  EXPECT_FALSE(tiltFromWobble({0.01, 0.0}, 0.0, M_PI));
}

// Many readings: exact without noise; with noise the sd that 7.1 predicts for two
TEST(ContactFormulas, ManyWobblesAreLeastSquares) {
  const Complex q(0.03, -0.041);
  std::vector<WobbleReading> readings;
  for (int k = 0; k < 7; ++k) {
    const Complex dq = std::polar(0.02, 0.9 * k);
    readings.push_back({dq, std::arg(q + dq) + (k % 2 ? M_PI : 0.0)});
  }
  const auto found = tiltFromReadings(readings);
  ASSERT_TRUE(found);
  EXPECT_LT(std::abs(*found - q), 1e-15);
  EXPECT_FALSE(tiltFromReadings({}));
  EXPECT_FALSE(tiltFromReadings({readings[0], readings[0]}));

  // two readings with noise: |q0| has sd σ hypot(|q0| cot Δa, |q1| / sin Δa); 4000 trials, sd of an
  // sd 1.1 %, second order in σ = 1e-3 far below
  std::mt19937 engine(3);
  std::normal_distribution<double> normal(0.0, 1e-3);
  const Complex dq = std::polar(0.02, std::arg(q) + 0.5 * M_PI);
  const double a0 = std::arg(q), a1 = std::arg(q + dq);
  double sum = 0.0;
  const int trials = 4000;
  for (int i = 0; i < trials; ++i) {
    const auto noisy = tiltFromReadings({{0.0, a0 + normal(engine)}, {dq, a1 + normal(engine)}});
    sum += std::pow(std::abs(*noisy) - std::abs(q), 2);
  }
  const double expected =
      1e-3 * std::hypot(std::abs(q) / std::tan(a1 - a0), std::abs(q + dq) / std::sin(a1 - a0));
  EXPECT_NEAR(std::sqrt(sum / trials), expected, 0.05 * expected);
}

// both edges of exact geometry give the hole to rounding, whatever the tilt; the thesis's formula
// is off by what clearance and tilt make
TEST(ContactFormulas, EdgesTellTheHole) {
  for (const double distance : {0.003, 0.015, 0.03, 0.045}) {
    for (const double tilt : {0.0, 0.02, 0.14}) {
      for (const double low : {0.3, 1.4, -2.8}) {
        const Complex centre = std::polar(distance, 0.7), q = std::polar(tilt, low);
        double a1 = 0.0, a2 = 0.0;
        crossings(q, centre, a1, a2);
        const auto found = holeFromEdges(kFormulaPeg, kFormulaHole, q, a1, a2);
        ASSERT_TRUE(found);
        // directions to 1e-16; the circle through two near points stretches errors by 1 / sin
        EXPECT_LT(std::abs(*found - centre), 1e-12) << distance << " " << tilt << " " << low;
      }
    }
  }
  // untilted the distance has a closed form: r cos δ + √(r² cos² δ + R² − r²)
  double a1 = 0.0, a2 = 0.0;
  crossings(0.0, 0.015, a1, a2);
  const double c = kFormulaPeg * std::cos(0.5 * (a2 - a1));
  EXPECT_NEAR(c + std::sqrt(c * c + kFormulaHole * kFormulaHole - kFormulaPeg * kFormulaPeg), 0.015,
              1e-13);
  // equal radii: the error that the same closed form leaves
  const double bias = 0.015 - std::abs(equalRadiusCentre(kFormulaPeg, a1, a2));
  EXPECT_NEAR(bias, std::sqrt(c * c + kFormulaHole * kFormulaHole - kFormulaPeg * kFormulaPeg) - c,
              1e-13);
  EXPECT_GT(bias, 5e-5);
  // edges of a wider hole than this
  EXPECT_FALSE(centreThrough(0.01, {0.02, 0.0}, {-0.02, 0.0}, {0.0, 1.0}));
}

// the direction of a double contact and one of its edges do as well; its half turn doesn't matter
TEST(ContactFormulas, DoubleContactTellsTheHole) {
  for (const double distance : {0.005, 0.03}) {
    for (const double tilt : {0.0, 0.02}) {
      // in double contact the low side points to the hole, afterwards the peg has turned about it
      const double toward = -1.1;
      const Complex q = Complex(tilt, -0.03) * std::polar(1.0, toward);
      const Complex centre = std::polar(distance, toward);
      double behind = 0.0, ahead = 0.0;
      crossings(q, centre, behind, ahead);
      for (const double alpha : {toward, toward + M_PI}) {
        for (const double a_c : {behind, ahead}) {
          const auto found = holeFromDouble(kFormulaPeg, kFormulaHole, q, alpha, a_c);
          ASSERT_TRUE(found);
          EXPECT_LT(std::abs(*found - centre), 1e-12);
        }
      }
    }
  }
}

TEST(ContactFormulas, TurnTellsTheTiltTowardTheHole) {
  const double alpha = 0.4, tilt = 0.02;
  std::vector<TurnReading> readings;
  for (const double turn : {0.05, 0.07, -0.06}) {
    const Complex q = Complex(tilt, -turn) * std::polar(1.0, alpha);
    readings.push_back({turn, std::arg(q) + (turn < 0.06 ? M_PI : 0.0)});
  }
  const auto found = tiltFromDouble(alpha, readings);
  ASSERT_TRUE(found);
  EXPECT_NEAR(*found, tilt, 1e-15);
  // read the other way round, tilt and rotation have the other sign
  for (TurnReading& r : readings) r.turn = -r.turn;
  EXPECT_NEAR(*tiltFromDouble(alpha + M_PI, readings), -tilt, 1e-15);
  EXPECT_FALSE(tiltFromDouble(alpha, {}));
  EXPECT_FALSE(tiltFromDouble(alpha, {{0.01, alpha}}));
  // the projected edge itself: an ellipse with semi-axes r cos T and r
  const Complex q = std::polar(0.3, 0.9);
  EXPECT_NEAR(std::abs(edgePoint(kFormulaPeg, q, 0.9)), kFormulaPeg * std::cos(0.3), 1e-15);
  EXPECT_NEAR(std::abs(edgePoint(kFormulaPeg, q, 0.9 + 0.5 * M_PI)), kFormulaPeg, 1e-15);
  EXPECT_LT(angleError(std::arg(edgePoint(kFormulaPeg, q, 2.2)), 2.2), 1e-15);
}
