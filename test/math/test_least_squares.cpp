// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "assembly_cell/math/least_squares.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// Rosenbrock's function as residuals: minimum 0 at (1, 1).
class Rosenbrock {
 public:
  static Vector2d residuals(const Vector2d& x) { return {10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]}; }
  void linearise(const Vector2d& x) {
    Matrix2d J;
    J << -20.0 * x[0], 10.0, -1.0, 0.0;
    H_ = J.transpose() * J;
    g_ = J.transpose() * residuals(x);
    costs.push_back(residuals(x).squaredNorm());
  }
  Vector2d step(double damping) const {
    Matrix2d damped = H_;
    damped.diagonal() *= 1.0 + damping;
    dampings.push_back(damping);
    return -damped.llt().solve(g_);
  }
  bool small(const Vector2d& step) const { return step.norm() < 1e-12; }
  double cost(const Vector2d& x) const { return residuals(x).squaredNorm(); }

  std::vector<double> costs;             // of the accepted states
  mutable std::vector<double> dampings;  // of all steps

 private:
  Matrix2d H_;
  Vector2d g_;
};

// r = atan(x): plain Gauss–Newton diverges from |x| > 1.39.
class ArcTangent {
 public:
  void linearise(double x) { step_ = -std::atan(x) * (1.0 + x * x); }
  double step(double /*damping*/) const { return step_; }
  bool small(double step) const { return std::abs(step) < 1e-14; }
  double cost(double x) const { return std::pow(std::atan(x), 2); }

 private:
  double step_ = 0.0;
};

TEST(LeastSquares, DampingLowersTheCostWithEachAcceptedStep) {
  LeastSquaresOptions options;
  options.max_iterations = 100;
  options.damping.initial = 1e-3;
  Rosenbrock problem;
  Vector2d x(-1.2, 1.0);
  const LeastSquaresResult result = minimise<StepControl::kDamping>(problem, x, options);
  EXPECT_LT((x - Vector2d::Ones()).norm(), 1e-12);
  EXPECT_LT(result.cost, 1e-24);
  EXPECT_LT(result.iterations, 60);
  EXPECT_GT(problem.dampings.size(), problem.costs.size());  // some steps failed
  for (std::size_t k = 1; k < problem.costs.size(); ++k) {
    EXPECT_LT(problem.costs[k], problem.costs[k - 1]) << k;
  }
}

TEST(LeastSquares, DampingStartsAgainAfterAFailureAndEndsAtZero) {
  LeastSquaresOptions options;
  options.max_iterations = 200;
  options.damping.off = 1e-6;
  options.damping.restart = 1e-3;
  Rosenbrock problem;
  Vector2d x(-1.2, 1.0);
  minimise<StepControl::kDamping>(problem, x, options);
  EXPECT_LT((x - Vector2d::Ones()).norm(), 1e-12);
  EXPECT_EQ(problem.dampings[0], 0.0);
  EXPECT_EQ(problem.dampings[1], 1e-3);  // the first plain step fails
  EXPECT_EQ(problem.dampings.back(), 0.0);
}

TEST(LeastSquares, HalvingConvergesWhereThePlainStepDiverges) {
  ArcTangent problem;
  double x = 3.0;
  minimise<StepControl::kHalving>(problem, x, {});
  EXPECT_LT(std::abs(x), 1e-14);
  x = 3.0;
  LeastSquaresOptions options;
  options.max_iterations = 3;
  const LeastSquaresResult result = minimise<StepControl::kNone>(problem, x, options);
  EXPECT_GT(std::abs(x), 100.0);
  EXPECT_EQ(result.iterations, 3);
}

TEST(LeastSquares, StepsAreShortened) {
  ArcTangent problem;
  double x = 3.0;
  LeastSquaresOptions options;
  options.max_step = 0.25;
  options.max_iterations = 1;
  minimise<StepControl::kNone>(problem, x, options);
  EXPECT_EQ(x, 2.75);
  Rosenbrock curved;
  Vector2d y(-1.2, 1.0);
  minimise<StepControl::kNone>(curved, y, options);
  EXPECT_NEAR((y - Vector2d(-1.2, 1.0)).norm(), 0.25, 1e-15);
}

TEST(LeastSquares, StopsAtALargeDampingAndAtASmallDecrease) {
  // no step lowers this cost
  class Blocked : public ArcTangent {
   public:
    double cost(double x) const { return x == 1.0 ? 1.0 : std::nan(""); }
  };
  LeastSquaresOptions options;
  options.max_iterations = 1000;
  options.damping.initial = 1.0;
  options.damping.max = 1e3;
  Blocked blocked;
  double x = 1.0;
  const LeastSquaresResult result = minimise<StepControl::kDamping>(blocked, x, options);
  EXPECT_EQ(x, 1.0);
  EXPECT_EQ(result.cost, 1.0);
  EXPECT_EQ(result.iterations, 3);  // 10, 100, 1000, then above the bound

  options.min_decrease = 1e-3;
  Rosenbrock problem;
  Vector2d y(-1.2, 1.0);
  const LeastSquaresResult early = minimise<StepControl::kDamping>(problem, y, options);
  EXPECT_LT(problem.costs.back() - early.cost, 1e-3);
  options.min_decrease = 0.0;
  y = Vector2d(-1.2, 1.0);
  EXPECT_GT(minimise<StepControl::kDamping>(problem, y, options).iterations, early.iterations);
}

}  // namespace
}  // namespace assembly_cell
