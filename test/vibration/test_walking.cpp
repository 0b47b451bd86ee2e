// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Walking, thesis 4.31 to 4.41 (its Table 4.2: kg, mm, s).
#include "assembly_cell/vibration/walking.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "assembly_cell/vibration/inertia.h"
#include "support/refusals.h"
#include "support/thesis_forms.h"

namespace assembly_cell {
namespace {

WalkCase table42(double F, double w, int cycles = 40) {
  return {0.766, 9806.6, 25, 25, 1e7, F, w, .96, cycles};
}

// Mean step per cycle over 40 cycles at each frequency of Fig 4.23 [mm], printed digits; irregular
// in between
TEST(Walk, Table42GoesOutward) {
  constexpr double kMean[][2] = {
      {40, -.0007}, {60, -.0008}, {80, -.0060}, {120, -.0009}, {200, -.0004}};
  for (const auto& row : kMean) {
    const Walk x = walk(table42(1500, row[0]));
    EXPECT_NEAR(x.dx / 40, row[1], 5e-5) << row[0];
    EXPECT_FALSE(x.tension);
    // not one hop per half cycle
    EXPECT_GE(x.phases.size(), 40u);
    EXPECT_LT(x.phases.size(), 80u);
    // the first hop, on A, is outward
    EXPECT_LT(x.phases[0].outward_step, 0);
    EXPECT_TRUE(x.phases[0].on_a);
  }
}

// below m g s/(2h) = 1052 mN nothing lifts, but next to the resonance (91 rad/s) inertia lifts
TEST(Walk, NeedsForce) {
  EXPECT_NEAR(liftingForce(0.766, 9806.6, 25, 25, std::acos(.96)), 1051.66, 0.01);
  for (const double w : {40.0, 60.0, 120.0, 200.0}) {
    EXPECT_TRUE(walk(table42(1000, w)).phases.empty()) << w;
  }
  EXPECT_FALSE(walk(table42(1000, 80)).phases.empty());
}

// Euler–Lagrange about the pivot, without principal axes: RK4 in main axes to 1e-10 of the motion
TEST(Walk, PhasesSolveTheEquationsOfMotion) {
  const WalkCase c = table42(1500, 60, 3);
  const Walk x = walk(c);
  using Vector = Eigen::Matrix<long double, 3, 1>;
  using Matrix = Eigen::Matrix<long double, 3, 3>;
  const long double d = 24, s = 7;
  for (std::size_t i = 1; i < x.segments.size(); ++i) {
    const WalkSegment& segment = x.segments[i];
    if (segment.pivot == 0) continue;
    const Vector arm(-d, -s * segment.pivot, c.h);
    const long double transverse = centroidInertia(c.m, c.r, c.h);
    Matrix I = Vector(transverse, transverse, c.m * c.r * c.r / 2).asDiagonal();
    I += c.m * (arm.squaredNorm() * Matrix::Identity() - arm * arm.transpose());
    const Matrix inverse = I.inverse();
    const auto acceleration = [&](long double t, const Vector& q) {
      const Vector F(c.F * std::cos(c.w * t), c.F * std::sin(c.w * t), 0);
      const Vector moment =
          (arm + Vector(0, 0, c.h)).cross(F) + arm.cross(Vector(0, 0, -c.m * c.g));
      return Vector(inverse * (moment - c.K * q));
    };
    Vector q(0, segment.theta_Y, segment.theta_Z), v(0, segment.theta_Y_dot, 0);
    const double end = x.segments[i + 1].start;
    const int steps = 2000;
    const long double h = (static_cast<long double>(end) - segment.start) / steps;
    long double t = segment.start;
    for (int k = 0; k < steps; ++k, t += h) {
      const Vector a1 = acceleration(t, q), v2 = v + h / 2 * a1;
      const Vector a2 = acceleration(t + h / 2, q + h / 2 * v), v3 = v + h / 2 * a2;
      const Vector a3 = acceleration(t + h / 2, q + h / 2 * v2), v4 = v + h * a3;
      const Vector a4 = acceleration(t + h, q + h * v3);
      q += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
      v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    const WalkSegment& next = x.segments[i + 1];
    EXPECT_NEAR(0, static_cast<double>(q.x()), 1e-10 * 0.02);
    EXPECT_NEAR(next.theta_Y, static_cast<double>(q.y()), 1e-10 * 0.02);
    EXPECT_NEAR(next.theta_Z, static_cast<double>(q.z()), 1e-10 * 0.02);
    // landing: angular momentum about the chord before = after, I of the chord
    const long double before = (I * v).y();
    EXPECT_NEAR(next.theta_Y_dot * static_cast<double>(I(1, 1)), static_cast<double>(before),
                1e-10 * std::abs(static_cast<double>(before)) + 1e-9);
  }
}

TEST(Walk, MotionIsContinuousAndKeepsItsPivot) {
  const WalkCase c = table42(1500, 60, 3);
  const Walk x = walk(c);
  for (const WalkPhase& phase : x.phases) {
    const WalkMotion before = walkMotion(c, x, phase.t_lift * (1 - 1e-12));
    const WalkMotion after = walkMotion(c, x, phase.t_lift * (1 + 1e-12));
    EXPECT_NEAR(before.theta_Y, after.theta_Y, 1e-10);
    EXPECT_NEAR(before.theta_Z, after.theta_Z, 1e-10);
    const WalkMotion middle = walkMotion(c, x, phase.t_lift + phase.duration / 2);
    EXPECT_LT((phase.on_a ? 1 : -1) * middle.theta_X, 0);
    EXPECT_DOUBLE_EQ(phase.outward_step, (phase.on_a ? 7 : -7) * phase.dZ);
  }
}

// SI gives the same walk in metres; chaos magnifies the conversion's rounding, so few cycles
TEST(Walk, ScalesWithUnits) {
  const Walk a = walk(table42(1500, 60, 5));
  const Walk b = walk({0.766, 9.8066, .025, .025, 10, 1.5, 60, .96, 5});
  ASSERT_EQ(a.phases.size(), b.phases.size());
  EXPECT_NEAR(b.dx * 1e3, a.dx, 1e-7 * std::abs(a.dx));
}

TEST(Walk, Limit) {
  // mu = .2, r = h = 25: 8.35 % of the diameter
  const WalkingLimit x = walkingLimit(.2, 25, 25);
  EXPECT_NEAR(x.alpha, std::asin(.4), 1e-15);
  EXPECT_NEAR(x.overlap, 4.174, 5e-4);
  EXPECT_NEAR(x.overlap / 50, .0835, 5e-5);
  EXPECT_NEAR(walkingLimit(1e-9, 25, 25).overlap, 25 * 4e-18, 1e-30);  // 2r·sin²/2, not cancelled
  EXPECT_DOUBLE_EQ(walkingLimit(.7, 25, 25).alpha, M_PI / 2);
  EXPECT_DOUBLE_EQ(walkingLimit(.7, 25, 25).overlap, 50);
}

TEST(Walk, Refusals) {
  const auto refusal = [](auto spoil) {
    WalkCase c = table42(1500, 60);
    spoil(c);
    return refusalOf([&] { walk(c); });
  };
  EXPECT_NE(refusal([](auto& c) { c.cos_alpha = 1; }).find("cos_alpha: value 1.0"),
            std::string::npos);
  EXPECT_NE(refusal([](auto& c) { c.cycles = 0; }).find("cycles"), std::string::npos);
  EXPECT_NE(refusal([](auto& c) { c.K = 0; }).find("K:"), std::string::npos);
  EXPECT_NE(refusal([](auto& c) { c.w = 1e-9; }).find("w:"), std::string::npos);
  EXPECT_NE(refusalOf([] { walkingLimit(-1, 1, 1); }).find("mu"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
