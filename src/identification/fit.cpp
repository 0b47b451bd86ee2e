// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"
#include "assembly_cell/math/least_squares.h"
#include "problem.h"

namespace assembly_cell {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::Problem;
using identification::Rows;

constexpr int kMaxIterations = 30;
constexpr double kSettled = 1e-4;  // largest component of the last step, in deviations of the prior

constexpr double kModelErrors[] = {0.2, 0.02, 0.0};  // relative to a reading's force, in stages

struct Solution {
  VectorXd z;
  MatrixXd covariance;
  double chi2 = 0.0;  // prior included
  int data = 0, iterations = 0;
};

// Negative log posterior of z, doubled: ‖r(z)‖² + ‖z‖², for minimise().
class Posterior {
 public:
  explicit Posterior(const Problem& problem)
      : problem_(problem), unit_(MatrixXd::Identity(problem.size(), problem.size())) {}

  void linearise(const VectorXd& z) {
    at_ = z;
    rows_ = problem_.rows(z, false, true);
    information_ = rows_.jacobian.transpose() * rows_.jacobian + unit_;
    slope_ = rows_.jacobian.transpose() * rows_.residual - z;
  }
  VectorXd step(double damping) const {
    const MatrixXd damped = information_ + MatrixXd(damping * information_.diagonal().asDiagonal());
    return damped.llt().solve(slope_);
  }
  double cost(const VectorXd& z) const {
    return problem_.rows(z, false, false).residual.squaredNorm() + z.squaredNorm();
  }
  bool small(const VectorXd& step) const { return step.cwiseAbs().maxCoeff() < kSettled; }

  MatrixXd covariance(const VectorXd& z) {
    if (z != at_) linearise(z);
    return information_.llt().solve(unit_);
  }
  int data() const { return static_cast<int>(rows_.residual.size()); }

 private:
  const Problem& problem_;
  MatrixXd unit_, information_;
  VectorXd at_, slope_;
  Rows rows_;
};

// Maximum a posteriori, from s.z.
void refine(const Problem& problem, Solution& s) {
  LeastSquaresOptions options;
  options.max_iterations = kMaxIterations;
  options.damping.off = 1e-6;
  options.damping.restart = 1e-3;
  Posterior posterior(problem);
  const LeastSquaresResult result = minimise<StepControl::kDamping>(posterior, s.z, options);
  s.covariance = posterior.covariance(s.z);
  s.chi2 = result.cost;
  s.data = posterior.data();
  s.iterations += result.iterations;
}

// The likelihood is so narrow that the nearest minimum need not be the best one: the first stages
// assume larger errors, so that the prior dominates.
Solution solve(const Mechanism& nominal, const IdentificationData& data,
               const IdentificationPrior& prior) {
  Solution s;
  for (const double error : kModelErrors) {
    IdentificationPrior now = prior;
    now.hanging_model = std::max(now.hanging_model, error);
    now.pressed_model = std::max(now.pressed_model, error);
    const Problem problem(nominal, data, now);
    if (s.z.size() == 0) s.z = VectorXd::Zero(problem.size());
    refine(problem, s);
  }
  return s;
}

// χ² of held-out rows with the covariance of their noise and of the posterior.
double misfit(const Rows& rows, const MatrixXd& covariance) {
  const MatrixXd expected = rows.jacobian * covariance * rows.jacobian.transpose() +
                            MatrixXd::Identity(rows.residual.size(), rows.residual.size());
  return rows.residual.dot(expected.llt().solve(rows.residual));
}

std::string nameOf(const VibrationReading& reading) {
  std::string name = "hanging";
  if (reading.place) name = "pressed at place " + std::to_string(*reading.place + 1);
  return name + text(", %.0f rad/s ", reading.exciter.frequency) +
         (reading.exciter.direction > 0 ? "anticlockwise" : "clockwise");
}

void checkHeldOut(const Problem& problem, const IdentificationData& data, const Solution& solution,
                  Identification& result) {
  const Rows all = problem.rows(solution.z, true, true);
  result.dof = static_cast<int>(all.residual.size());
  result.chi2 = result.dof > 0 ? misfit(all, solution.covariance) : 0.0;
  result.p = chiSquareTail(result.chi2, result.dof);
  const HeldOutGroup* worst = nullptr;
  for (const VibrationReading& reading : data.vibrations) {
    if (!reading.held_out) continue;
    const Rows rows = problem.rows(solution.z, reading, true);
    HeldOutGroup group;
    group.name = nameOf(reading);
    group.dof = static_cast<int>(rows.residual.size());
    group.chi2 = misfit(rows, solution.covariance);
    group.p = chiSquareTail(group.chi2, group.dof);
    result.groups.push_back(group);
  }
  for (const HeldOutGroup& group : result.groups) {
    if (!worst || group.chi2 > worst->chi2) worst = &group;
  }
  result.accepted = result.dof > 0 && result.p >= kHeldOutLevel;
  if (result.accepted) {
    result.verdict = "accepted";
  } else if (result.dof == 0) {
    result.verdict = "refused: no data were left out to check the fit";
  } else {
    result.verdict =
        text("refused: data left out disagree, chi2 %.0f of %d, most ", result.chi2, result.dof) +
        worst->name + text(" (%.0f of %d)", worst->chi2, worst->dof);
  }
}

void nameUnseen(Identification& result) {
  for (int i = 0; i < kUnknowns; ++i) {
    if (result.sd(i) > kUnseen) result.unseen.push_back(i);
    for (int k = 0; k < i; ++k) {
      const double correlation = result.covariance(i, k) / (result.sd(i) * result.sd(k));
      if (std::abs(correlation) > kCorrelated) result.correlated.push_back({k, i, correlation});
    }
  }
  const MatrixXd covariance = result.covariance;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance, Eigen::EigenvaluesOnly);
  result.condition = eigen.eigenvalues()[kUnknowns - 1] / eigen.eigenvalues()[0];
}

}  // namespace

Identification identify(const Mechanism& nominal, const IdentificationData& data,
                        const IdentificationPrior& prior) {
  if (data.vibrations.empty()) {
    throw InputError("identification: no vibration was read, there is nothing to fit");
  }
  const Problem problem(nominal, data, prior);
  const Solution solution = solve(nominal, data, prior);
  Identification result;
  result.unknowns = prior.unknowns;
  result.z = solution.z.head<kUnknowns>();
  result.covariance = solution.covariance.topLeftCorner<kUnknowns, kUnknowns>();
  result.model = modelAt(nominal, prior.unknowns, result.z);
  result.fit_chi2 = solution.chi2;
  result.fit_dof = solution.data;
  result.iterations = solution.iterations;
  result.notes = data.notes;
  for (const VibrationReading& reading : data.vibrations) {
    result.fitted.push_back(problem.fitted(solution.z, reading));
  }
  checkHeldOut(problem, data, solution, result);
  nameUnseen(result);
  return result;
}

}  // namespace assembly_cell
