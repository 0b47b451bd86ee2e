// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/contact_formulas.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

using namespace assembly_cell;
using Complex = std::complex<double>;
using Long = std::complex<long double>;

namespace {

constexpr double kFormulaPeg = 0.025, kFormulaHole = 0.02505;

// Point of the projected edge of a peg tilted by q, in direction a: of the edge tilted about the
// horizontal axis across q.
Long edgeAt(Complex q, long double a) {
  const long double low = q == 0.0 ? 0.0L : std::arg(Long(q));
  const long double shrink = std::cos(static_cast<long double>(std::abs(q)));
  const long double s = std::atan2(shrink * std::sin(a - low), std::cos(a - low));
  return static_cast<long double>(kFormulaPeg) * Long(shrink * std::cos(s), std::sin(s)) *
         std::polar(1.0L, low);
}

// Both crossings of it with the rim of a hole at `centre`, by bisection: the edge contacts, first
// the one behind the hole's direction.
std::pair<Complex, Complex> crossings(Complex q, Complex centre) {
  const long double toward = std::arg(Long(centre));
  const auto find = [&](long double sign) {
    long double in = 0.0L, out = static_cast<long double>(M_PI);
    for (int i = 0; i < 80; ++i) {
      const long double half = 0.5L * (in + out);
      const bool outside = std::abs(edgeAt(q, toward + sign * half) - Long(centre)) >
                           static_cast<long double>(kFormulaHole);
      (outside ? out : in) = half;
    }
    return Complex(edgeAt(q, toward + sign * in));
  };
  return {find(-1.0L), find(1.0L)};
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

// both edges of exact geometry give the hole to rounding, whatever the tilt
TEST(ContactFormulas, EdgesDetermineTheHole) {
  for (const double distance : {0.003, 0.015, 0.03, 0.045}) {
    for (const double tilt : {0.0, 0.02, 0.14}) {
      for (const double low : {0.3, 1.4, -2.8}) {
        const Complex centre = std::polar(distance, 0.7), q = std::polar(tilt, low);
        const auto [behind, ahead] = crossings(q, centre);
        const auto found = centreThrough(kFormulaHole, behind, ahead, behind + ahead);
        ASSERT_TRUE(found);
        // points to 1e-18 m; the circle through two near points stretches errors by 1 / sin
        EXPECT_LT(std::abs(*found - centre), 1e-12) << distance << " " << tilt << " " << low;
      }
    }
  }
  // untilted the distance has a closed form: r cos δ + √(r² cos² δ + R² − r²)
  const auto [behind, ahead] = crossings(0.0, 0.015);
  const double c = kFormulaPeg * std::cos(0.5 * std::arg(ahead / behind));
  EXPECT_NEAR(c + std::sqrt(c * c + kFormulaHole * kFormulaHole - kFormulaPeg * kFormulaPeg), 0.015,
              1e-13);
  // edges of a wider hole than this
  EXPECT_FALSE(centreThrough(0.01, {0.02, 0.0}, {-0.02, 0.0}, {0.0, 1.0}));
}

TEST(ContactFormulas, RotationDeterminesTheTiltTowardTheHole) {
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
}
