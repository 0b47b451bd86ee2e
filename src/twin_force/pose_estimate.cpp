// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/pose_estimate.h"

#include <algorithm>
#include <cmath>

#include "fit.h"
#include "input_check.h"

namespace assembly_cell {

using twin_force::Fit;
using twin_force::Problem;
using twin_force::RobustSolution;
using twin_force::Term;

struct TwinForceWorkspace::Memory {
  std::size_t capacity = 0;
  std::vector<Term> terms, reversed;
  std::vector<int> used, trial;
  twin_force::TareState tare;
  twin_force::ErrorState errors;
  TwinForceEstimate estimate;
};

namespace {

using Memory = TwinForceWorkspace::Memory;

constexpr double kMinForce = 20.0;  // minimum force of a contact, in its sd
// Component of a null direction above which a variance is infinite; eigenvectors are accurate to
// 1e-10.
constexpr double kNullPart = 1e-6;

void report(const Vector6& scale, const Fit& fit, TwinForceEstimate& e) {
  e.scale = scale;
  e.pose = fit.pose;
  e.rotation = fit.q.w() < 0.0 ? Eigen::Quaterniond(-fit.q.coeffs()) : fit.q;
  e.information = fit.normal.information;
  e.eigenvalues = fit.eigenvalues;
  e.weak_direction = fit.eigenvectors.col(0);
  e.null_count = fit.null_count;
  e.null_directions.setZero();
  e.null_directions.leftCols(fit.null_count) = fit.eigenvectors.leftCols(fit.null_count);
  e.tare = fit.tare_offset;
  e.error_slope = fit.error_slope;
  e.error_rest = fit.error_rest;
  e.iterations = fit.iterations;
  e.covariance.setZero();
  for (int k = fit.null_count; k < 6; ++k) {
    const Vector6 v = scale.cwiseProduct(fit.eigenvectors.col(k));
    e.covariance += v * v.transpose() / fit.eigenvalues[k];
  }
}

// Directions that the closed form left at their initial values are unobservable, whatever the
// likelihood.
void markUnobservable(const RobustSolution& robust, TwinForceEstimate& e) {
  const int unknown = robust.dropped_count + (robust.turn_known ? 0 : 1);
  if (unknown <= e.null_count) return;
  e.null_count = 0;
  e.null_directions.setZero();
  for (int k = 0; k < robust.dropped_count; ++k) {
    e.null_directions.col(e.null_count++).head<3>() = robust.dropped.col(k);
  }
  if (!robust.turn_known) {
    e.null_directions.col(e.null_count++).tail<3>() = robust.mean_axis;
  }
}

void fillVariance(TwinForceEstimate& e) {
  e.variance = e.covariance.diagonal();
  for (int k = 0; k < e.null_count; ++k) {
    for (int i = 0; i < 6; ++i) {
      if (std::abs(e.null_directions(i, k)) > kNullPart) {
        e.variance[i] = std::numeric_limits<double>::infinity();
      }
    }
  }
}

// Clears an estimate; keeps the memory of its lists.
void clear(TwinForceEstimate& e) {
  std::vector<int> rejected = std::move(e.rejected), too_light = std::move(e.too_light);
  rejected.clear();
  too_light.clear();
  e = TwinForceEstimate();
  e.rejected = std::move(rejected);
  e.too_light = std::move(too_light);
}

void refuse(TwinForceEstimate& e, TwinForceStatus status, const char* reason, int culprit = -1) {
  e.status = status;
  e.reason = reason;
  e.culprit = culprit;
}

// Terms of the contacts; used: those with enough force on both sensors.
void selectContacts(const std::vector<TwinContact>& contacts, Memory& memory) {
  memory.terms.clear();
  memory.used.clear();
  const double limit = kMinForce * kMinForce;
  int n = 0;
  for (const TwinContact& c : contacts) {
    memory.terms.push_back(twin_force::makeTerm(c));
    const bool enough =
        c.wrench_a.head<3>().squaredNorm() >= limit * twin_force::forceVariance(c.covariance_a) &&
        c.wrench_b.head<3>().squaredNorm() >= limit * twin_force::forceVariance(c.covariance_b);
    (enough ? memory.used : memory.estimate.too_light).push_back(n++);
  }
}

// For an inconsistent fit: checks for reversed signs of one sensor, and removes outliers.
void repair(const Problem& problem, Memory& memory, Fit& fit) {
  const double smallest_p = problem.options.smallest_p;
  TwinForceEstimate& e = memory.estimate;
  memory.reversed = memory.terms;
  for (Term& t : memory.reversed) {
    t.F_B = -t.F_B;
    t.M_B = -t.M_B;
  }
  Problem reversed = problem;
  reversed.terms = &memory.reversed;
  e.opposed_signs = fitSubset(reversed, memory.used).p >= smallest_p;
  while (!e.opposed_signs && problem.options.remove_outliers && fit.p < smallest_p &&
         memory.used.size() >= 3) {
    std::size_t out = 0, ignored = 0;
    fit = bestRemoval(problem, memory.used, memory.trial, out);
    if (memory.used.size() > 3 && fit.p < smallest_p) {
      e.opposed_signs = bestRemoval(reversed, memory.used, memory.trial, ignored).p >= smallest_p;
      if (e.opposed_signs) break;
    }
    e.rejected.push_back(memory.used[out]);
    memory.used.erase(memory.used.begin() + static_cast<std::ptrdiff_t>(out));
  }
  std::sort(e.rejected.begin(), e.rejected.end());
}

// Contacts that are consistent to their noise: the pose is replaced by that of the likelihood
// without errors, which weights all by their noise; the stated covariance stays.
void preferWithoutErrors(const Problem& problem, Memory& memory, TwinForceEstimate& e) {
  Problem bare = problem;
  bare.errors = nullptr;
  if (problem.options.tare_covariance) bare.tare = &memory.tare;
  const Fit fit = fitSubset(bare, memory.used);
  if (fit.p < problem.options.smallest_p || fit.null_count > e.null_count) return;
  e.pose = fit.pose;
  e.rotation = fit.q.w() < 0.0 ? Eigen::Quaterniond(-fit.q.coeffs()) : fit.q;
}

void evaluateAccuracy(TwinForceEstimate& e) {
  if (e.null_count > 0) {
    e.status = TwinForceStatus::kDegenerate;
    e.reason = "some directions can't be seen, see null_directions";
  } else if (e.eigenvalues[0] < 1.0 || e.unconfirmed) {
    e.status = TwinForceStatus::kWeak;
    e.reason = e.unconfirmed ? "two contacts are left, nothing confirms them"
                             : "less accurate than required in the weak direction";
  } else {
    e.status = TwinForceStatus::kOk;
  }
}

}  // namespace

TwinForceWorkspace::TwinForceWorkspace(std::size_t capacity) : memory_(std::make_unique<Memory>()) {
  memory_->capacity = capacity;
  memory_->terms.reserve(capacity);
  memory_->reversed.reserve(capacity);
  memory_->used.reserve(capacity);
  memory_->trial.reserve(capacity);
  memory_->estimate.rejected.reserve(capacity);
  memory_->estimate.too_light.reserve(capacity);
}
TwinForceWorkspace::~TwinForceWorkspace() = default;
TwinForceWorkspace::TwinForceWorkspace(TwinForceWorkspace&&) noexcept = default;
TwinForceWorkspace& TwinForceWorkspace::operator=(TwinForceWorkspace&&) noexcept = default;

const char* toString(TwinForceStatus status) {
  constexpr const char* kNames[] = {"OK",
                                    "WEAK",
                                    "DEGENERATE",
                                    "REFUSE",
                                    "REFUSE_TOO_FEW",
                                    "REFUSE_SINGULAR",
                                    "REFUSE_INCONSISTENT"};
  return kNames[static_cast<int>(status)];
}

bool hasPose(TwinForceStatus status) {
  return status == TwinForceStatus::kOk || status == TwinForceStatus::kWeak ||
         status == TwinForceStatus::kDegenerate;
}

const TwinForceEstimate& estimatePose(const std::vector<TwinContact>& contacts,
                                      const TwinForceOptions& options,
                                      TwinForceWorkspace& workspace) {
  Memory& memory = workspace.memory();
  TwinForceEstimate& e = memory.estimate;
  twin_force::checkInput(contacts, options, memory.capacity);
  clear(e);
  if (const auto refusal = twin_force::refusalOf(contacts, options)) {
    refuse(e, TwinForceStatus::kRefuse, refusal->reason, refusal->culprit);
    return e;
  }
  selectContacts(contacts, memory);
  if (memory.used.size() < 2) {
    refuse(e, TwinForceStatus::kRefuseTooFew, "fewer than 2 contacts with enough force");
    return e;
  }

  const Problem problem = makeProblem(memory.terms, contacts, options, memory.tare, memory.errors);
  const bool thesis = options.method == TwinForceMethod::kThesis;
  Fit fit;
  Matrix6 own_covariance = Matrix6::Zero();
  if (!thesis) {
    fit = fitSubset(problem, memory.used);
    if (fit.p < options.smallest_p) repair(problem, memory, fit);
  } else if (!fitThesis(problem, memory.used, fit, own_covariance)) {
    refuse(e, TwinForceStatus::kRefuseSingular,
           "the printed form is singular here: parallel forces, aligned parts or a translation "
           "along a force");
    return e;
  }
  e.chi2 = fit.normal.chi2;
  e.dof = fit.dof;
  e.p = fit.p;
  if (fit.p < options.smallest_p) {
    refuse(e, TwinForceStatus::kRefuseInconsistent,
           e.opposed_signs ? "one sensor's sign is reversed against the other's"
                           : "the contacts contradict one another");
    return e;
  }

  report(problem.scale, fit, e);
  if (problem.errors != nullptr) preferWithoutErrors(problem, memory, e);
  if (thesis) e.covariance = own_covariance;
  if (options.method == TwinForceMethod::kRobust) {
    const RobustSolution robust = solveRobust(memory.terms, memory.used, problem.start);
    // no likelihood step: covariance of the closed form
    if (robust.pose.p == fit.pose.p) {
      e.covariance = robustCovariance(memory.terms, memory.used, robust);
      markUnobservable(robust, e);
    }
  }
  fillVariance(e);
  e.unconfirmed = !e.rejected.empty() && memory.used.size() == 2;
  evaluateAccuracy(e);
  return e;
}

Matrix6 coordinateCovariance(const TwinForceEstimate& estimate) {
  Matrix6 out = estimate.covariance;
  for (int i = 0; i < 6; ++i) {
    if (std::isfinite(estimate.variance[i])) continue;
    out.row(i).setZero();
    out.col(i).setZero();
    out(i, i) = estimate.variance[i];
  }
  return out;
}

}  // namespace assembly_cell
