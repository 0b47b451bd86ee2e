// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tipping, impact and flight, thesis 4.42 to 4.48 (its Table 4.3: kg, mm, s).
#include "assembly_cell/vibration/bounce.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/single_dof.h"
#include "support/refusals.h"

namespace assembly_cell {
namespace {

TipCase table43(double kx) {
  return {0.766, 9806.6, 25, 25, 12.5, kx, 1e7, 2500, 60, M_PI / 3, .3};
}

TEST(TipBounce, Table43) {
  constexpr double kX[][2] = {{2300, -1.54e-7}, {1280, -8.6e-8}, {2000, -1.34e-7}};
  for (const auto& row : kX) {
    const TipResult x = tipBounce(table43(row[0]));
    EXPECT_NEAR(*x.t_flight, .243e-3, 5e-7);
    EXPECT_NEAR(*x.X_end, row[1], 5e-10);
    // 4.42, and the impulse of 4.8.3
    EXPECT_NEAR(2 * 2500 * 25 * std::sin(60 * *x.t_tip), .766 * 9806.6 * 12.5, 1e-6);
    const double I = chordInertia(.766, 25, 25, 12.5);
    EXPECT_NEAR(*x.impulse, .3 * I * std::abs(*x.omega_impact) / 37.5, 1e-12);
    const SingleDof tip{I, 1e7, 0, 0, 125000, -.766 * 9806.6 * 12.5, 60, *x.t_tip, 0, 0};
    EXPECT_NEAR(singleDof(tip, *x.t_impact).theta, 0, 1e-15);
    EXPECT_GT(singleDof(tip, (*x.t_tip + *x.t_impact) / 2).theta, 0);
  }
}

TEST(TipBounce, UndefinedFromWhatDoesNotHappen) {
  TipCase c = table43(1280);
  c.F = 1500;  // 2Fh < m g d
  EXPECT_FALSE(tipBounce(c).t_tip);
  c = table43(1280);
  c.restitution = 0;
  EXPECT_TRUE(tipBounce(c).t_impact);
  EXPECT_FALSE(tipBounce(c).t_flight);
  // d = 14.58 mm is where the edge leaves the chord
  EXPECT_NEAR(centroidInertia(.766, 25, 25) / (.766 * 25), 14.58, .005);
  c = table43(1280);
  c.F = 3500;
  c.alpha = std::acos(14.5 / 25);
  EXPECT_TRUE(tipBounce(c).t_flight);
  c.alpha = std::acos(14.7 / 25);
  EXPECT_FALSE(tipBounce(c).t_flight);
  c.F = 3800;  // 2Fh > m g r
  EXPECT_NE(refusalOf([&] { tipBounce(c); }).find("F: value 3800.0"), std::string::npos);
  c = table43(2600);
  EXPECT_NE(refusalOf([&] { tipBounce(c); }).find("K_chord"), std::string::npos);
  c = table43(0);
  c.restitution = 1.1;
  EXPECT_NE(refusalOf([&] { tipBounce(c); }).find("restitution"), std::string::npos);
}

// RK4 in long double of m X'' + kx (X + (l+h) theta) = 0, I theta'' + (Krot + kx (l+h)²) theta + kx
// (l+h) X = 0
TEST(FreeFlight, SolvesTheEquationsOfMotion) {
  for (const double Krot : {0.0, 6e5, 1e7}) {
    for (const double kx : {0.0, 1280.0}) {
      for (const double end : {2.4e-4, 0.05, 0.2}) {
        const FreeFlight f{.766, 279.27, kx, Krot, 25, 12.5, 25, 6.4, 9806.6};
        const long double arm = 37.5;
        long double X = 0, theta = 0, largest = 0, V = 0,
                    spin = f.J * static_cast<long double>(f.r) / f.I;
        const auto force = [&](long double x, long double q) { return -kx * (x + arm * q) / f.m; };
        const auto moment = [&](long double x, long double q) {
          return -((Krot + kx * arm * arm) * q + kx * arm * x) / f.I;
        };
        const int steps = 20000;
        const long double h = static_cast<long double>(end) / steps;
        for (int k = 0; k < steps; ++k) {
          const long double a1 = force(X, theta), b1 = moment(X, theta);
          const long double a2 = force(X + h / 2 * V, theta + h / 2 * spin),
                            b2 = moment(X + h / 2 * V, theta + h / 2 * spin);
          const long double a3 = force(X + h / 2 * (V + h / 2 * a1),
                                       theta + h / 2 * (spin + h / 2 * b1)),
                            b3 = moment(X + h / 2 * (V + h / 2 * a1),
                                        theta + h / 2 * (spin + h / 2 * b1));
          const long double a4 = force(X + h * (V + h / 2 * a2), theta + h * (spin + h / 2 * b2)),
                            b4 = moment(X + h * (V + h / 2 * a2), theta + h * (spin + h / 2 * b2));
          largest = std::max(largest, std::abs(X));
          X += h * V + h * h / 6 * (a1 + a2 + a3);
          theta += h * spin + h * h / 6 * (b1 + b2 + b3);
          V += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
          spin += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4);
        }
        const FreeFlightState x = freeFlight(f, end);
        EXPECT_NEAR(x.X, static_cast<double>(X), 1e-10 * static_cast<double>(largest))
            << kx << " " << Krot << " " << end;
        EXPECT_NEAR(x.theta, static_cast<double>(theta), 1e-10 * .57 * end);
        EXPECT_DOUBLE_EQ(x.Z, 6.4 / .766 * end - 9806.6 * end * end / 2);
      }
    }
  }
}

TEST(FreeFlight, ModesAndLimits) {
  const FreeFlight f{.766, 279.27, 1280, 6e5, 25, 12.5, 25, 6.4, 9806.6};
  const FreeFlightState x = freeFlight(f, 1e-3);
  const double K = 6e5 + 1280 * 37.5 * 37.5;
  EXPECT_NEAR(x.w_hi * x.w_hi + x.w_lo * x.w_lo, 1280 / .766 + K / 279.27, 1e-9);
  EXPECT_NEAR(x.w_hi * x.w_lo, std::sqrt(1280 / .766 * 6e5 / 279.27), 1e-9);
  FreeFlight free = f;
  free.Krot = 0;
  EXPECT_EQ(freeFlight(free, 1e-3).w_lo, 0);
  free.kx = 0;
  EXPECT_EQ(freeFlight(free, 1e-3).X, 0);
  EXPECT_NEAR(freeFlight(free, 1e-3).theta, 6.4 * 25 / 279.27 * 1e-3, 1e-18);
  EXPECT_NE(refusalOf([&] { freeFlight(f, -1); }).find("t:"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
