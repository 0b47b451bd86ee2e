// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/hole_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

using namespace assembly_cell;
using Eigen::Vector3d;

namespace {

constexpr double kFitPeg = 0.025, kFitHole = 0.0251;

// The touching point of a peg that is lowered in this orientation, by brute force and independent
// of the product's contact search: the lowest edge point that is not over the hole. Hole at the
// origin.
double touch(const Eigen::Matrix3d& R, const Vector3d& bottom, double& height) {
  const auto point = [&](double a) {
    return Vector3d(R * Vector3d(kFitPeg * std::cos(a), kFitPeg * std::sin(a), 0.0) + bottom);
  };
  const auto blocked = [&](double a) { return point(a).head<2>().norm() >= kFitHole; };
  constexpr int kGrid = 7200;
  double best = 1e9, best_a = 0.0;
  const auto consider = [&](double a) {
    if (blocked(a) && point(a).z() < best) {
      best = point(a).z();
      best_a = a;
    }
  };
  for (int i = 0; i < kGrid; ++i) {
    const double a = 2 * M_PI * i / kGrid, b = 2 * M_PI * (i + 1) / kGrid;
    consider(a);
    // the rim between two samples, by bisection
    if (blocked(a) != blocked(b)) {
      double in = blocked(a) ? a : b, out = blocked(a) ? b : a;
      for (int k = 0; k < 60; ++k) (blocked(0.5 * (in + out)) ? in : out) = 0.5 * (in + out);
      consider(in);
    }
  }
  // a lowest point on the plane, between samples
  double low = best_a - 2 * M_PI / kGrid, high = best_a + 2 * M_PI / kGrid;
  for (int k = 0; k < 80; ++k) {
    const double a = high - 0.618 * (high - low), b = low + 0.618 * (high - low);
    (point(a).z() < point(b).z() ? high : low) = point(a).z() < point(b).z() ? b : a;
  }
  consider(0.5 * (low + high));
  height = best;
  return best_a;
}

struct Scene {
  Pose X_SH;  // hole in S
  std::vector<HoleReading> readings;
};

// a sweep of `count` readings at a commanded tilt; alpha modulo pi, with noise
Scene sweep(const Vector3d& offset, double hole_tilt, double tilt, int count, double noise,
            unsigned seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(0.0, noise);
  Scene scene;
  scene.X_SH.R = rotationFromVector({Vector3d(hole_tilt * 0.6, -hole_tilt * 0.8, 0.0)});
  scene.X_SH.p = offset;
  for (int i = 0; i < count; ++i) {
    const double a = 2 * M_PI * (i + 0.37) / count;
    const Eigen::Matrix3d R_SP =
        rotationFromVector({tilt * Vector3d(-std::sin(a), std::cos(a), 0.0)});
    Pose X_HP = inverse(scene.X_SH) * Pose{R_SP, Vector3d::Zero()};
    double height = 0.0;
    const double alpha = touch(X_HP.R, X_HP.p, height);
    X_HP.p.z() -= height;
    HoleReading r;
    r.X_SP = scene.X_SH * X_HP;
    r.alpha = alpha + (i % 2 ? M_PI : 0.0) + normal(engine);
    r.sd = std::max(noise, 1e-6);
    scene.readings.push_back(r);
  }
  return scene;
}

}  // namespace

// exact readings give the exact hole: the touching points come from bisection to 1e-15 rad, the
// golden section on the flat bottom of the edge to about 1e-8 rad, 3e-10 m
TEST(HoleFit, ExactWithoutNoise) {
  for (const double offset : {0.0005, 0.002, 0.006, 0.015, 0.03}) {
    for (const double hole_tilt : {0.0, 0.02}) {
      Scene s = sweep({-0.8 * offset, 0.6 * offset, -0.003}, hole_tilt, 0.052, 36, 0.0, 1);
      HoleEstimate e;
      ASSERT_TRUE(fitHole(kFitPeg, kFitHole, s.readings, e).good()) << offset << " " << hole_tilt;
      EXPECT_LT((e.center - s.X_SH.p).norm(), 1e-7) << offset << " " << hole_tilt;
      EXPECT_LT((e.normal - s.X_SH.R.col(2)).norm(), 1e-6);
    }
  }
}

// C or C* is resolved for every reading: half of them were turned by pi
TEST(HoleFit, ResolvesTheOppositeContact) {
  Scene s = sweep({0.004, 0.001, -0.002}, 0.015, 0.052, 36, 0.0, 1);
  HoleEstimate e;
  ASSERT_TRUE(fitHole(kFitPeg, kFitHole, s.readings, e).good());
  for (const HoleReading& r : s.readings) {
    const Vector3d p =
        r.X_SP.R * Vector3d(kFitPeg * std::cos(r.alpha), kFitPeg * std::sin(r.alpha), 0.0) +
        r.X_SP.p;
    EXPECT_NEAR(e.normal.dot(p), e.height, 1e-7);
  }
}

// With noise the error of the centre follows its covariance. That is taken from the scatter of
// ν = n − 2 rim readings, so the normalised square is Hotelling's T² of two dimensions: mean
// 2ν/(ν − 2). Within 20 %: the mean over 200 runs has an sd of about 10 %.
TEST(HoleFit, CovarianceIsHonest) {
  double sum = 0.0, expected = 0.0;
  for (unsigned k = 0; k < 200; ++k) {
    Scene s = sweep({0.005, -0.002, -0.002}, 0.01, 0.052, 36, 0.003, 100 + k);
    HoleEstimate e;
    ASSERT_TRUE(fitHole(kFitPeg, kFitHole, s.readings, e).good());
    const Eigen::Vector2d error = planeAxes(e.normal).transpose() * (e.center - s.X_SH.p);
    sum += error.dot(e.center_covariance.inverse() * error);
    const double dof = e.rim_readings - 2;
    expected += 2.0 * dof / (dof - 2.0);
  }
  EXPECT_NEAR(sum / expected, 1.0, 0.2);
}

// one contact that was read wrong by 20 degrees does no harm
TEST(HoleFit, WithstandsAnOutlier) {
  Scene s = sweep({0.005, -0.002, -0.002}, 0.01, 0.052, 36, 0.002, 3);
  HoleEstimate clean;
  std::vector<HoleReading> readings = s.readings;
  ASSERT_TRUE(fitHole(kFitPeg, kFitHole, readings, clean).good());
  for (std::size_t i = 0; i < readings.size(); ++i) {
    readings = s.readings;
    readings[i].alpha += 0.35;
    HoleEstimate e;
    ASSERT_TRUE(fitHole(kFitPeg, kFitHole, readings, e).good()) << i;
    EXPECT_LT((e.center - s.X_SH.p).norm(), 2e-4) << "reading " << i;
  }
}

TEST(HoleFit, NamesWhyItCannot) {
  Scene s = sweep({0.005, 0.0, -0.002}, 0.0, 0.052, 36, 0.0, 1);
  HoleEstimate e;
  std::vector<HoleReading> few(s.readings.begin(), s.readings.begin() + 3);
  EXPECT_EQ(fitHole(kFitPeg, kFitHole, few, e).failure, AlignFailure::kNoPlaneReading);
  // a peg that is nowhere over the hole
  Scene away = sweep({0.08, 0.0, -0.002}, 0.0, 0.052, 36, 0.0, 1);
  EXPECT_EQ(fitHole(kFitPeg, kFitHole, away.readings, e).failure, AlignFailure::kNoHoleUnderEdge);
}
