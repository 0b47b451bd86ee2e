// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Sliding force ratios, thesis 4.19 to 4.28 (its peg: kg, mm, s) and the design map.
#include "assembly_cell/vibration/sliding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/steady_state.h"
#include "support/refusals.h"

namespace assembly_cell {
namespace {

SlidingCase thesis(double kx, double w, double phi, double theta) {
  return {1e7, chordInertia(0.766, 25, 25, 12.5), w, 25, kx, 12.5, 0.766, 9806.6, phi, theta, 12.5};
}

// worked out apart from this code, to the digits given
TEST(SlidingRatio, Table) {
  constexpr double kAt[5][2] = {{.05, .005}, {.1, .005}, {.1, .02}, {.2, .005}, {.2, .02}};
  struct Row {
    double kx, w;
    SlidingBand band;
    double D, p1[5], p2[5];
  };
  const Row rows[] = {{0,
                       50,
                       SlidingBand::kLow,
                       156115,
                       {.131, .156, .468, .205, .508},
                       {.082, .057, .385, .006, .340}},
                      {0,
                       95,
                       SlidingBand::kLow,
                       41574,
                       {.055, .080, .170, .130, .219},
                       {.005, -.020, .071, -.070, .020}},
                      {0,
                       200,
                       SlidingBand::kHigh,
                       -502167,
                       {.353, .375, 1.274, .418, 1.242},
                       {.309, .286, 1.351, .239, 1.398}},
                      {1280,
                       50,
                       SlidingBand::kLow,
                       76115,
                       {.078, .103, .261, .153, .308},
                       {.028, .003, .164, -.047, .115}},
                      {1280,
                       95,
                       SlidingBand::kIntermediate,
                       -38426,
                       {.048, .073, .141, .123, .190},
                       {-.002, -.027, .043, -.077, -.008}},
                      {1280,
                       200,
                       SlidingBand::kHigh,
                       -582167,
                       {.406, .426, 1.453, .467, 1.398},
                       {.363, .341, 1.590, .296, 1.678}},
                      {2560,
                       95,
                       SlidingBand::kIntermediate,
                       -118426,
                       {.101, .126, .348, .175, .391},
                       {.051, .026, .259, -.024, .212}},
                      {2560,
                       200,
                       SlidingBand::kHigh,
                       -662167,
                       {.458, .477, 1.629, .515, 1.549},
                       {.417, .397, 1.834, .353, 1.970}}};
  for (const Row& row : rows) {
    for (int k = 0; k < 5; ++k) {
      const SlidingRatio x = slidingRatio(thesis(row.kx, row.w, kAt[k][0], kAt[k][1]));
      EXPECT_EQ(x.band, row.band);
      EXPECT_NEAR(x.D, row.D, 0.5);
      EXPECT_NEAR(*x.p1, row.p1[k], 5.001e-4) << row.kx << " " << row.w << " " << k;
      EXPECT_NEAR(*x.p2, row.p2[k], 5.001e-4) << row.kx << " " << row.w << " " << k;
    }
  }
}

TEST(SlidingRatio, BandLimits) {
  EXPECT_NEAR(slidingRatio(thesis(1280, 50, .1, .01)).w_lower, 82.7, 0.05);
  EXPECT_NEAR(slidingRatio(thesis(2560, 50, .1, .01)).w_lower, 47.7, 0.05);
  const SlidingRatio x = slidingRatio(thesis(0, 50, .1, .01));
  EXPECT_DOUBLE_EQ(x.w_lower, x.w_upper);
  EXPECT_NEAR(x.w_upper, 106.74, 0.005);
  // D changes its sign there
  const SlidingRatio y = slidingRatio(thesis(1280, 1, .1, .01));
  EXPECT_EQ(slidingRatio(thesis(1280, y.w_lower * .999, .1, .01)).band, SlidingBand::kLow);
  EXPECT_EQ(slidingRatio(thesis(1280, y.w_lower * 1.001, .1, .01)).band,
            SlidingBand::kIntermediate);
  EXPECT_EQ(slidingRatio(thesis(1280, y.w_upper * 1.001, .1, .01)).band, SlidingBand::kHigh);
}

// the exact rule: p1 > p2 if and only if |D| theta < m g, wherever both contacts press
TEST(SlidingRatio, ReversalRule) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  int reversed = 0, kept = 0;
  for (int run = 0; run < 20000; ++run) {
    const SlidingCase s = thesis(2560 * unit(random), 300 * unit(random), 0.01 + 0.3 * unit(random),
                                 0.03 * unit(random));
    const SlidingRatio x = slidingRatio(s);
    if (!x.p1 || !x.p2) continue;
    const double load = std::abs(x.D) * s.theta / (s.m * s.g);
    if (std::abs(load - 1) < 1e-9) continue;
    EXPECT_EQ(*x.p1 > *x.p2, load < 1);
    ++(load < 1 ? kept : reversed);
  }
  EXPECT_GT(reversed, 100);
  EXPECT_GT(kept, 100);
}

// 4.23–4.28 in their corrected printed form, one band each: same numbers to rounding
TEST(SlidingRatio, PrintedFormsCorrected) {
  for (const double w : {50.0, 95.0, 200.0}) {
    const SlidingCase s = thesis(1280, w, .1, .01);
    const SlidingRatio x = slidingRatio(s);
    const double mg = s.m * s.g, a = s.phi, th = s.theta;
    const double minus = std::cos((a - th) / 2), plus = std::cos((a + th) / 2);
    const double sin_minus = std::sin((a - th) / 2), sin_plus = std::sin((a + th) / 2);
    double p1, p2;
    if (x.band == SlidingBand::kLow) {  // 4.23, 4.24
      p1 = (mg * sin_plus + x.D * th * minus) / (mg * plus + x.D * th * sin_minus);
      p2 = (-mg * sin_minus + x.D * th * plus) / (mg * minus - x.D * th * sin_plus);
    } else {  // 4.25–4.28
      const double force = -x.D * th;
      p1 = (mg * sin_minus + force * plus) / (mg * minus + force * sin_plus);
      p2 = (-mg * sin_plus + force * minus) / (mg * plus - force * sin_minus);
    }
    EXPECT_NEAR(*x.p1, p1, 1e-14);
    EXPECT_NEAR(*x.p2, p2, 1e-14);
  }
}

TEST(SlidingRatio, InertiaForces) {
  const SlidingRatio x = slidingRatio(thesis(0, 200, .1, .005));
  // D' = D + m h w² = +263833 at 200 rad/s: with weight m (g − d w² x) at both ends
  const SlidingCase s = thesis(0, 200, .1, .005);
  EXPECT_NEAR(x.D + s.m * s.h * s.w * s.w, 263833, 0.5);
  const auto p = [&](double rotation) {
    const double weight = s.m * (s.g - s.d * s.w * s.w * rotation), force = 263833.333 * rotation;
    return (weight * std::sin((s.phi + rotation) / 2) + force * std::cos((s.phi - rotation) / 2)) /
           (weight * std::cos((s.phi + rotation) / 2) + force * std::sin((s.phi - rotation) / 2));
  };
  EXPECT_NEAR(*x.p1_inertia, p(.005), 1e-6);
  EXPECT_NEAR(*x.p2_inertia, -p(-.005), 1e-6);
  // no reversal at any frequency while the chord presses, for the thesis peg
  for (double w = 1; w < 1000; w += 1) {
    const SlidingRatio y = slidingRatio(thesis(1280, w, .1, .02 * std::min(1.0, 1e4 / (w * w))));
    if (y.p1_inertia && y.p2_inertia) {
      EXPECT_GT(*y.p1_inertia, *y.p2_inertia) << w;
    }
  }
}

TEST(SlidingRatio, LimitsAndSymmetry) {
  // no vibration: p1 = tan(phi/2) = −p2; no tilt: p1 = p2
  const SlidingRatio still = slidingRatio(thesis(1280, 50, .1, 0));
  EXPECT_NEAR(*still.p1, std::tan(.05), 1e-15);
  EXPECT_NEAR(*still.p2, -std::tan(.05), 1e-15);
  const SlidingRatio upright = slidingRatio(thesis(1280, 50, 0, .02));
  EXPECT_NEAR(*upright.p1, *upright.p2, 1e-15);
  // tilt the other way: in and out change places
  const SlidingRatio a = slidingRatio(thesis(1280, 50, .1, .02)),
                     b = slidingRatio(thesis(1280, 50, -.1, .02));
  EXPECT_NEAR(*a.p1, *b.p2, 1e-15);
  // SI: same ratios
  const SlidingRatio si = slidingRatio({10, chordInertia(.766, .025, .025, .0125), 50, .025, 1280,
                                        .0125, .766, 9.8066, .1, .02, .0125});
  EXPECT_NEAR(*si.p1, *a.p1, 1e-13);
  EXPECT_NEAR(*si.p2_inertia, *a.p2_inertia, 1e-13);
  // small angles: p1 − p2 is phi, first order
  EXPECT_NEAR(*a.p1 - *a.p2, .1, .01);
}

TEST(SlidingRatio, UndefinedWhereTheContactsLift) {
  const SlidingRatio x = slidingRatio(thesis(1280, 400, .1, .02));
  EXPECT_FALSE(x.p1_inertia);
  EXPECT_NE(refusalOf([] { slidingRatio(thesis(2600, 50, .1, .02)); }).find("K: value"),
            std::string::npos);
  EXPECT_NE(refusalOf([] { slidingRatio(thesis(0, 50, 2, .02)); }).find("phi"), std::string::npos);
  EXPECT_NE(refusalOf([] { slidingRatio(thesis(0, 50, .1, -1)); }).find("theta"),
            std::string::npos);
}

// ---- design aid ----

DesignCase design() { return {0.766, 25, 25, 9806.6, 1e7, 1280, 12.5, 12.5, .1, .2, true}; }

TEST(DesignPoint, FollowsFromItsParts) {
  DesignCase c = design();
  for (const bool inertia : {false, true}) {
    c.inertia = inertia;
    for (const double w : {20.0, 50.0, 90.0, 120.0, 200.0}) {
      for (const double F : {0.0, 300.0, 1000.0, 2000.0, 5000.0}) {
        const DesignPoint x = designPoint(c, w, F);
        const double I = chordInertia(c.m, c.r, c.h, c.d);
        EXPECT_NEAR(x.theta, std::abs(doubleContact(F, c.h, c.K, I, w, 0)), 1e-12);
        // sampled normal force of the lighter contact
        double lowest = 1e300;
        for (int k = 0; k < 720; ++k) {
          const double a = k * M_PI / 360;
          const double up = c.g - c.d * w * w * x.theta * std::cos(a);
          lowest = std::min(lowest,
                            up - 2 * c.h * F * std::abs(std::sin(a)) / (c.m * std::sqrt(468.75)));
        }
        const bool lifts =
            x.outcome == VibrationOutcome::kLifts || x.outcome == VibrationOutcome::kWalksOut;
        if (std::abs(lowest) > 1e-3 * c.g) {
          EXPECT_EQ(lifts, lowest < 0) << w << " " << F;
        }
        if (!lifts) {
          EXPECT_EQ(x.outcome == VibrationOutcome::kAssembles, *x.p1 > c.mu && *x.p2 <= c.mu);
          EXPECT_EQ(x.outcome == VibrationOutcome::kSticks, *x.p1 <= c.mu && *x.p2 <= c.mu);
        }
      }
    }
  }
  // 4.41: with enough friction what lifts walks
  c.mu = 0.9;
  EXPECT_EQ(designPoint(c, 50, 5000).outcome, VibrationOutcome::kWalksOut);
  c.mu = 0.4;
  EXPECT_EQ(designPoint(c, 50, 5000).outcome, VibrationOutcome::kLifts);
  // resonance: no amplitude, but an answer
  EXPECT_EQ(designPoint(c, std::sqrt(c.K / chordInertia(c.m, c.r, c.h, c.d)), 10).theta, 0.5);
}

}  // namespace
}  // namespace assembly_cell
