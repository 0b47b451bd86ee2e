// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/pose_estimate.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/scene/yaml_text.h"
#include "closed_forms.h"
#include "likelihood.h"

namespace assembly_cell {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using twin_force::Normal;
using twin_force::RobustSolution;
using twin_force::TareState;
using twin_force::Term;

namespace {

constexpr double kAsymmetry = 1e-6;       // of sqrt(c_ii c_jj), rounding of printed numbers
constexpr double kSmallestPivot = 1e-12;  // of the diagonal entry
constexpr double kNearParallel = 0.35;    // second singular value of the forces: multi-start
constexpr double kLongestTurn = 0.5;      // of one step [rad]
constexpr double kSmallTurn = 0.1;        // of the robust form's correction [rad]
constexpr double kConverged = 1e-12;      // step over the arm, and turn [rad]
constexpr double kDecrement = 1e-18;      // δᵀIδ: a step of 1e-9 sd
constexpr double kNullPart = 1e-6;        // of a null direction that makes a variance infinite

// One fit of a subset of the contacts.
struct Fit {
  Pose pose;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Normal normal;
  Vector12 tare_offset = Vector12::Zero();
  int iterations = 0;
  bool solved = false;
  // filled by judge()
  Vector6 eigenvalues;
  Matrix6 eigenvectors;
  int null_count = 0, dof = 0;
  double p = 0.0;
};

}  // namespace

struct TwinForceWorkspace::Memory {
  std::size_t capacity = 0;
  std::vector<Term> terms, reversed;
  std::vector<int> used, trial;
  TareState tare;
  TwinForceEstimate estimate;
};

namespace {

using Memory = TwinForceWorkspace::Memory;

Vector6 scaleOf(const TwinForceOptions& options) {
  Vector6 s;
  s << Vector3d::Constant(options.required_position), Vector3d::Constant(options.required_rotation);
  return s;
}

double survival(double chi2, int dof) {
  if (dof <= 0) return 1.0;
  if (!(chi2 < 1e6)) return 0.0;
  return boost::math::gamma_q(0.5 * dof, 0.5 * chi2);
}

// Normal equations at a pose; with a tare offset, of the pose alone.
void assemble(const std::vector<Term>& terms, const std::vector<int>& used, const Pose& X,
              const PosePrior* prior, const Matrix6& prior_weight, TareState* tare,
              Normal& normal) {
  normal = Normal();
  if (tare == nullptr) {
    for (const int i : used) {
      twin_force::add(twin_force::whiten(terms[static_cast<std::size_t>(i)], X.R, X.p), X.p,
                      normal);
    }
  } else {
    twin_force::begin(*tare);
    const Vector12 offset = tare->L * tare->z;
    for (const int i : used) {
      const Term& term = terms[static_cast<std::size_t>(i)];
      const twin_force::Whitened w = twin_force::whiten(term, X.R, X.p, &offset);
      twin_force::add(w, X.p, normal);
      twin_force::add(term, w, X, *tare);
    }
    twin_force::eliminate(*tare, normal);
  }
  if (prior != nullptr) twin_force::add(prior->pose, prior_weight, X, normal);
}

// Gauss–Helmert from a start, steps halved while the likelihood falls.
void climb(const std::vector<Term>& terms, const std::vector<int>& used, const Pose& start,
           const TwinForceOptions& options, const Matrix6& prior_weight, TareState* tare,
           Fit& fit) {
  const PosePrior* prior = options.prior ? &*options.prior : nullptr;
  const Vector6 scale = scaleOf(options);
  const double arm = options.required_position / options.required_rotation;
  fit.pose = start;
  fit.q = Eigen::Quaterniond(start.R);
  if (tare != nullptr) tare->z.setZero();
  assemble(terms, used, fit.pose, prior, prior_weight, tare, fit.normal);
  for (fit.iterations = 0; fit.iterations < options.largest_iterations; ++fit.iterations) {
    Vector6 step = twin_force::solveObservable(fit.normal, scale);
    const double angle = step.tail<3>().norm();
    if (angle > kLongestTurn) step *= kLongestTurn / angle;
    const Vector6 Lstep = fit.normal.information.selfadjointView<Eigen::Lower>() * step;
    const bool small = step.dot(Lstep) < kDecrement ||
                       (step.head<3>().norm() < kConverged * arm && angle < kConverged);
    Vector12 z = Vector12::Zero(), z_step = Vector12::Zero();
    if (tare != nullptr) {
      z = tare->z;
      z_step = twin_force::tareStep(*tare, step);
    }
    const Pose from = fit.pose;
    const Eigen::Quaterniond q = fit.q;
    const double before = fit.normal.chi2;
    double part = 1.0;
    for (int halvings = 0; halvings < 20; ++halvings, part *= 0.5) {
      fit.q = (twin_force::turn(part * step.tail<3>()) * q).normalized();
      fit.pose.R = fit.q.toRotationMatrix();
      fit.pose.p = from.p + part * step.head<3>();
      if (tare != nullptr) tare->z = z + part * z_step;
      // the last step moves nothing that matters
      if (small) break;
      assemble(terms, used, fit.pose, prior, prior_weight, tare, fit.normal);
      if (fit.normal.chi2 <= before + 1e-9 * (1.0 + before)) break;
    }
    if (small) break;
  }
  if (tare != nullptr) fit.tare_offset = tare->L * tare->z;
  fit.normal.information = Matrix6(fit.normal.information.selfadjointView<Eigen::Lower>());
  fit.solved = std::isfinite(fit.normal.chi2) && fit.pose.p.allFinite();
}

// Eigenvalues of Λ, degrees of freedom and the χ² test.
void judge(const TwinForceOptions& options, std::size_t contacts, bool with_prior, Fit& fit) {
  const Vector6 scale = scaleOf(options);
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scale.asDiagonal() * fit.normal.information *
                                                     scale.asDiagonal());
  fit.eigenvalues = eigen.eigenvalues();
  fit.eigenvectors = eigen.eigenvectors();
  fit.null_count = 0;
  while (fit.null_count < 6 && !(fit.eigenvalues[fit.null_count] >= twin_force::kUnobservable)) {
    ++fit.null_count;
  }
  fit.dof = 6 * static_cast<int>(contacts) - (6 - fit.null_count) + (with_prior ? 6 : 0);
  fit.p = fit.solved ? survival(fit.normal.chi2, fit.dof) : 0.0;
}

Fit fitLikelihood(const std::vector<Term>& terms, const std::vector<int>& used,
                  const TwinForceOptions& options, const Matrix6& prior_weight, TareState* tare) {
  const Pose start = options.prior ? options.prior->pose : Pose();
  RobustSolution robust = twin_force::solveRobust(terms, used, start);
  Fit best;
  climb(terms, used, robust.result.pose, options, prior_weight, tare, best);
  // near parallel lines: other turns about the mean line, and the prior
  if (robust.parallelism < kNearParallel) {
    const Matrix3d R = robust.result.pose.R;
    const int starts = options.prior ? 4 : 3;
    for (int k = 1; k <= starts; ++k) {
      if (k == 4) {
        robust.result.pose = start;
      } else {
        robust.result.pose.R = Eigen::AngleAxisd(k * 0.5 * M_PI, robust.mean_axis) * R;
        twin_force::solveTranslation(terms, used, start.p, robust);
      }
      Fit other;
      climb(terms, used, robust.result.pose, options, prior_weight, tare, other);
      other.iterations += best.iterations;
      // equal within rounding: the first start stands
      if (other.solved &&
          (!best.solved || other.normal.chi2 < best.normal.chi2 * (1.0 - 1e-9) - 1e-9)) {
        best = other;
      } else {
        best.iterations = other.iterations;
      }
    }
  }
  judge(options, used.size(), options.prior.has_value(), best);
  return best;
}

// χ² of a pose from another method: the likelihood's value one step further.
Vector6 fitAround(const std::vector<Term>& terms, const std::vector<int>& used, const Pose& pose,
                  const TwinForceOptions& options, Fit& fit) {
  fit.pose = pose;
  fit.q = Eigen::Quaterniond(pose.R);
  assemble(terms, used, pose, nullptr, Matrix6::Zero(), nullptr, fit.normal);
  const Vector6 step = twin_force::solveObservable(fit.normal, scaleOf(options));
  fit.normal.chi2 = std::max(0.0, fit.normal.chi2 + fit.normal.gradient.dot(step));
  fit.normal.information = Matrix6(fit.normal.information.selfadjointView<Eigen::Lower>());
  fit.solved = std::isfinite(fit.normal.chi2) && pose.p.allFinite();
  judge(options, used.size(), false, fit);
  return step;
}

// One likelihood step from a closed form makes it efficient, where nothing is near singular.
bool oneStepHelps(const RobustSolution& robust, const Vector6& step) {
  return !robust.result.couple_pairs && robust.result.dropped_count == 0 &&
         robust.result.turn_known && step.tail<3>().norm() < kSmallTurn;
}

Pose stepped(const Pose& X, const Vector6& step, Eigen::Quaterniond& q) {
  q = (twin_force::turn(step.tail<3>()) * Eigen::Quaterniond(X.R)).normalized();
  return {q.toRotationMatrix(), X.p + step.head<3>()};
}

Fit fitSubset(const std::vector<Term>& terms, const std::vector<int>& used,
              const TwinForceOptions& options, const Matrix6& prior_weight, TareState* tare) {
  if (options.method == TwinForceMethod::kMaximumLikelihood) {
    return fitLikelihood(terms, used, options, prior_weight, tare);
  }
  const Pose start = options.prior ? options.prior->pose : Pose();
  const RobustSolution robust = twin_force::solveRobust(terms, used, start);
  Fit fit;
  const Vector6 step = fitAround(terms, used, robust.result.pose, options, fit);
  if (oneStepHelps(robust, step)) fit.pose = stepped(fit.pose, step, fit.q);
  return fit;
}

// The thesis form from the pair with the largest denominators.
bool fitThesis(const std::vector<Term>& terms, const std::vector<int>& used,
               const TwinForceOptions& options, Fit& fit, Matrix6& covariance) {
  double best = std::numeric_limits<double>::infinity();
  for (const int i : used) {
    for (const int k : used) {
      if (i >= k) continue;
      const Term& a = terms[static_cast<std::size_t>(i)];
      const Term& b = terms[static_cast<std::size_t>(k)];
      Pose pose;
      Eigen::Matrix<double, 6, 12> slope;
      if (!twin_force::solveThesis(a, b, pose, &slope)) continue;
      const Matrix6 C = slope.leftCols<6>() * twin_force::residualCovariance(a, pose) *
                            slope.leftCols<6>().transpose() +
                        slope.rightCols<6>() * twin_force::residualCovariance(b, pose) *
                            slope.rightCols<6>().transpose();
      const Vector6 scale = scaleOf(options);
      const double size = C.diagonal().cwiseQuotient(scale.cwiseAbs2()).sum();
      if (size < best) {
        best = size;
        fit.pose = pose;
        covariance = 0.5 * (C + C.transpose());
      }
    }
  }
  if (!std::isfinite(best)) return false;
  fitAround(terms, used, fit.pose, options, fit);
  return true;
}

bool betterFit(const Fit& a, const Fit& b) {
  return a.p > b.p || (a.p == b.p && a.normal.chi2 < b.normal.chi2);
}

// The removal that leaves the best fit; `out` is its position in used.
Fit bestRemoval(const std::vector<Term>& terms, const std::vector<int>& used,
                const TwinForceOptions& options, const Matrix6& prior_weight, TareState* tare,
                std::vector<int>& trial, std::size_t& out) {
  Fit best;
  for (std::size_t k = 0; k < used.size(); ++k) {
    trial.assign(used.begin(), used.end());
    trial.erase(trial.begin() + static_cast<std::ptrdiff_t>(k));
    const Fit fit = fitSubset(terms, trial, options, prior_weight, tare);
    if (k == 0 || betterFit(fit, best)) {
      best = fit;
      out = k;
    }
  }
  return best;
}

struct Refusal {
  const char* reason;
  int culprit;
};

std::optional<Refusal> refusalOf(const std::vector<TwinContact>& contacts,
                                 const TwinForceOptions& options) {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const TwinContact& c = contacts[i];
    const int n = static_cast<int>(i);
    if (!c.wrench_a.allFinite() || !c.wrench_b.allFinite()) {
      return Refusal{"a wrench is not finite", n};
    }
    if (!c.move.R.allFinite() || !c.move.p.allFinite() || !std::isfinite(c.time_difference) ||
        std::isnan(c.tare_age)) {
      return Refusal{"a move or a time is not finite", n};
    }
    if ((c.move.R.transpose() * c.move.R - Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-6 ||
        c.move.R.determinant() < 0.0) {
      return Refusal{"a move's rotation is not a rotation", n};
    }
    if (c.saturated) return Refusal{"a sensor was saturated", n};
    if (c.tare_age > options.oldest_tare) return Refusal{"the tare is older than its limit", n};
    const double limit =
        c.moving ? options.largest_difference_moving : options.largest_difference_at_rest;
    if (std::abs(c.time_difference) > limit) {
      return Refusal{"the two wrenches are not simultaneous", n};
    }
  }
  return std::nullopt;
}

// a name is only put together for a message
std::string contactKey(std::size_t i, const char* key) {
  return "contacts[" + std::to_string(i) + "]." + key;
}

// What is wrong with a covariance, or null.
template <int N>
const char* covarianceFault(const Eigen::Matrix<double, N, N>& c, bool semidefinite) {
  if (!c.allFinite()) return "not finite";
  for (int i = 0; i < N; ++i) {
    if (c(i, i) < 0.0) return "indefinite";
    for (int j = 0; j < i; ++j) {
      if (std::abs(c(i, j) - c(j, i)) >
          kAsymmetry * std::sqrt(c(i, i)) * std::sqrt(std::abs(c(j, j)))) {
        return "asymmetric";
      }
    }
  }
  // Cholesky; a pivot is what is left of the diagonal entry
  const double smallest = semidefinite ? -1e-9 : kSmallestPivot;
  Eigen::Matrix<double, N, N> L = Eigen::Matrix<double, N, N>::Zero();
  for (int k = 0; k < N; ++k) {
    double pivot = c(k, k);
    for (int m = 0; m < k; ++m) pivot -= L(k, m) * L(k, m);
    if (semidefinite ? pivot < smallest * c(k, k) : !(pivot > smallest * c(k, k))) {
      return pivot < -1e-9 * c(k, k) ? "indefinite" : "singular";
    }
    const bool empty = pivot <= 1e-9 * c(k, k);
    for (int i = k + 1; i < N; ++i) {
      double value = 0.5 * (c(i, k) + c(k, i));
      for (int m = 0; m < k; ++m) value -= L(i, m) * L(k, m);
      // nothing can be correlated with what doesn't vary
      if (semidefinite && empty) {
        if (std::abs(value) > 1e-4 * std::sqrt(c(i, i)) * std::sqrt(c(k, k))) return "indefinite";
        continue;
      }
      L(i, k) = value / std::sqrt(pivot);
    }
    L(k, k) = semidefinite && empty ? 0.0 : std::sqrt(pivot);
  }
  return nullptr;
}

[[noreturn]] void refuseCovariance(const std::string& name, const char* fault, bool semidefinite) {
  throw InputError(name + ": value " + fault + ": give a finite, symmetric, " +
                   (semidefinite ? "positive semidefinite" : "positive definite") +
                   " covariance (force before moment, position before rotation)");
}

void checkInput(const std::vector<TwinContact>& contacts, const TwinForceOptions& options,
                std::size_t capacity) {
  if (contacts.size() > capacity) {
    throw InputError("contacts: value " + std::to_string(contacts.size()) +
                     " contacts: give at most " + std::to_string(capacity));
  }
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      throw InputError(std::string(name) + ": value " + yamlNumber(value) +
                       ": give a finite number > 0");
    }
  };
  positive(options.required_position, "required_position");
  positive(options.required_rotation, "required_rotation");
  positive(options.smallest_force, "smallest_force");
  if (!(options.smallest_p >= 0.0 && options.smallest_p < 1.0)) {
    throw InputError("smallest_p: value " + yamlNumber(options.smallest_p) +
                     ": give a probability in [0, 1)");
  }
  if (options.largest_iterations < 1) {
    throw InputError("largest_iterations: value " + std::to_string(options.largest_iterations) +
                     ": give a number >= 1");
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const TwinContact& c = contacts[i];
    if (const char* fault = covarianceFault(c.covariance_a, false)) {
      refuseCovariance(contactKey(i, "covariance_a"), fault, false);
    }
    if (const char* fault = covarianceFault(c.covariance_b, false)) {
      refuseCovariance(contactKey(i, "covariance_b"), fault, false);
    }
    if (c.move_covariance) {
      if (const char* fault = covarianceFault(*c.move_covariance, true)) {
        refuseCovariance(contactKey(i, "move_covariance"), fault, true);
      }
    }
  }
  if (options.prior) {
    if (const char* fault = covarianceFault(options.prior->covariance, false)) {
      refuseCovariance("prior.covariance", fault, false);
    }
    if (!options.prior->pose.p.allFinite() || !options.prior->pose.R.allFinite() ||
        (options.prior->pose.R.transpose() * options.prior->pose.R - Matrix3d::Identity())
                .cwiseAbs()
                .maxCoeff() > 1e-6) {
      throw InputError("prior: value not a pose: give a finite position and a unit quaternion");
    }
  }
  if (options.tare_covariance) {
    if (const char* fault = covarianceFault(*options.tare_covariance, true)) {
      refuseCovariance("tare_covariance", fault, true);
    }
  }
}

void report(const TwinForceOptions& options, const Fit& fit, TwinForceEstimate& e) {
  const Vector6 scale = scaleOf(options);
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
  e.iterations = fit.iterations;
  e.covariance.setZero();
  for (int k = fit.null_count; k < 6; ++k) {
    const Vector6 v = scale.cwiseProduct(fit.eigenvectors.col(k));
    e.covariance += v * v.transpose() / fit.eigenvalues[k];
  }
}

// What the closed form left at the start is unknown, whatever the likelihood could see there.
void keepUnknown(const RobustSolution& robust, TwinForceEstimate& e) {
  const int unknown = robust.result.dropped_count + (robust.result.turn_known ? 0 : 1);
  if (unknown <= e.null_count) return;
  e.null_count = 0;
  e.null_directions.setZero();
  for (int k = 0; k < robust.result.dropped_count; ++k) {
    e.null_directions.col(e.null_count++).head<3>() = robust.result.dropped.col(k);
  }
  if (!robust.result.turn_known) {
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

void clear(TwinForceEstimate& e) {
  e.status = TwinForceStatus::kRefuseTooFew;
  e.reason = "";
  e.culprit = -1;
  e.pose = Pose();
  e.rotation.setIdentity();
  e.covariance.setZero();
  e.variance.setConstant(std::numeric_limits<double>::infinity());
  e.information.setZero();
  e.chi2 = e.p = 0.0;
  e.dof = e.null_count = e.iterations = 0;
  e.eigenvalues.setZero();
  e.weak_direction.setZero();
  e.scale.setOnes();
  e.null_directions.setZero();
  e.rejected.clear();
  e.too_light.clear();
  e.unconfirmed = e.opposed_signs = false;
  e.tare.setZero();
}

void refuse(TwinForceEstimate& e, TwinForceStatus status, const char* reason, int culprit = -1) {
  e.status = status;
  e.reason = reason;
  e.culprit = culprit;
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
std::size_t TwinForceWorkspace::capacity() const { return memory_->capacity; }

const char* toString(TwinForceStatus status) {
  switch (status) {
    case TwinForceStatus::kOk:
      return "OK";
    case TwinForceStatus::kWeak:
      return "WEAK";
    case TwinForceStatus::kDegenerate:
      return "DEGENERATE";
    case TwinForceStatus::kRefuse:
      return "REFUSE";
    case TwinForceStatus::kRefuseTooFew:
      return "REFUSE_TOO_FEW";
    case TwinForceStatus::kRefuseSingular:
      return "REFUSE_SINGULAR";
    case TwinForceStatus::kRefuseInconsistent:
      break;
  }
  return "REFUSE_INCONSISTENT";
}

bool hasPose(TwinForceStatus status) {
  return status == TwinForceStatus::kOk || status == TwinForceStatus::kWeak ||
         status == TwinForceStatus::kDegenerate;
}

PosePrior defaultPrior(const Pose& nominal) {
  PosePrior prior;
  prior.pose = nominal;
  prior.covariance.setZero();
  prior.covariance.diagonal() << Vector3d::Constant(1e-4), Vector3d::Constant(1e-2);
  return prior;
}

void checkCovariance(const Matrix6& covariance, const std::string& name, bool semidefinite) {
  if (const char* fault = covarianceFault(covariance, semidefinite)) {
    refuseCovariance(name, fault, semidefinite);
  }
}

const TwinForceEstimate& estimatePose(const std::vector<TwinContact>& contacts,
                                      const TwinForceOptions& options,
                                      TwinForceWorkspace& workspace) {
  Memory& memory = workspace.memory();
  TwinForceEstimate& e = memory.estimate;
  checkInput(contacts, options, memory.capacity);
  clear(e);
  if (const auto refusal = refusalOf(contacts, options)) {
    refuse(e, TwinForceStatus::kRefuse, refusal->reason, refusal->culprit);
    return e;
  }

  // contacts with enough force on both sensors
  memory.terms.clear();
  memory.used.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const TwinContact& c = contacts[i];
    memory.terms.push_back(twin_force::makeTerm(c));
    const double limit = options.smallest_force * options.smallest_force;
    if (c.wrench_a.head<3>().squaredNorm() >= limit * twin_force::forceVariance(c.covariance_a) &&
        c.wrench_b.head<3>().squaredNorm() >= limit * twin_force::forceVariance(c.covariance_b)) {
      memory.used.push_back(static_cast<int>(i));
    } else {
      e.too_light.push_back(static_cast<int>(i));
    }
  }
  if (memory.used.size() < 2) {
    refuse(e, TwinForceStatus::kRefuseTooFew, "fewer than 2 contacts with enough force");
    return e;
  }

  // constants of the run
  TareState* tare = nullptr;
  if (options.tare_covariance && options.method == TwinForceMethod::kMaximumLikelihood) {
    const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(*options.tare_covariance);
    memory.tare.L =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
    tare = &memory.tare;
  }
  Matrix6 prior_weight = Matrix6::Zero();
  if (options.prior) prior_weight = options.prior->covariance.llt().solve(Matrix6::Identity());

  // thesis form: two contacts, no repair
  Fit fit;
  Matrix6 own_covariance = Matrix6::Zero();
  if (options.method == TwinForceMethod::kThesis) {
    if (!fitThesis(memory.terms, memory.used, options, fit, own_covariance)) {
      refuse(e, TwinForceStatus::kRefuseSingular,
             "the printed form is singular here: parallel forces, aligned parts or a translation "
             "along a force");
      return e;
    }
  } else {
    fit = fitSubset(memory.terms, memory.used, options, prior_weight, tare);
  }

  // inconsistent: reversed signs of one sensor, or outliers
  if (fit.p < options.smallest_p && options.method != TwinForceMethod::kThesis) {
    memory.reversed = memory.terms;
    for (Term& t : memory.reversed) {
      t.F_B = -t.F_B;
      t.M_B = -t.M_B;
    }
    e.opposed_signs = fitSubset(memory.reversed, memory.used, options, prior_weight, tare).p >=
                      options.smallest_p;
    while (!e.opposed_signs && options.remove_outliers && fit.p < options.smallest_p &&
           memory.used.size() >= 3) {
      std::size_t out = 0, ignored = 0;
      fit = bestRemoval(memory.terms, memory.used, options, prior_weight, tare, memory.trial, out);
      if (memory.used.size() > 3 && fit.p < options.smallest_p) {
        e.opposed_signs = bestRemoval(memory.reversed, memory.used, options, prior_weight, tare,
                                      memory.trial, ignored)
                              .p >= options.smallest_p;
        if (e.opposed_signs) break;
      }
      e.rejected.push_back(memory.used[out]);
      memory.used.erase(memory.used.begin() + static_cast<std::ptrdiff_t>(out));
    }
    std::sort(e.rejected.begin(), e.rejected.end());
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

  report(options, fit, e);
  if (options.method == TwinForceMethod::kRobust) {
    const Pose start = options.prior ? options.prior->pose : Pose();
    const RobustSolution robust = twin_force::solveRobust(memory.terms, memory.used, start);
    // not stepped: the closed form's own covariance
    if (robust.result.pose.p == fit.pose.p) {
      e.covariance = twin_force::robustCovariance(memory.terms, memory.used, robust);
      keepUnknown(robust, e);
    }
  } else if (options.method == TwinForceMethod::kThesis) {
    e.covariance = own_covariance;
  }
  fillVariance(e);

  e.unconfirmed = !e.rejected.empty() && memory.used.size() == 2;
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
  return e;
}

RobustPose robustPose(const std::vector<TwinContact>& contacts, const Pose& start,
                      TwinForceWorkspace& workspace) {
  Memory& memory = workspace.memory();
  if (contacts.size() < 2 || contacts.size() > memory.capacity) {
    throw InputError("contacts: value " + std::to_string(contacts.size()) +
                     " contacts: give 2 to " + std::to_string(memory.capacity));
  }
  memory.terms.clear();
  memory.used.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    memory.terms.push_back(twin_force::makeTerm(contacts[i]));
    memory.used.push_back(static_cast<int>(i));
  }
  RobustSolution robust = twin_force::solveRobust(memory.terms, memory.used, start);
  Normal normal;
  assemble(memory.terms, memory.used, robust.result.pose, nullptr, Matrix6::Zero(), nullptr,
           normal);
  const Vector6 step = twin_force::solveObservable(normal, scaleOf(TwinForceOptions()));
  Eigen::Quaterniond q;
  if (oneStepHelps(robust, step)) robust.result.pose = stepped(robust.result.pose, step, q);
  return robust.result;
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

double normalisedDistance(const TwinForceEstimate& estimate, const Pose& pose) {
  Vector6 d;
  d << pose.p - estimate.pose.p, vectorFromRotation(pose.R * estimate.pose.R.transpose()).value;
  // in units of what is required; null directions are orthonormal there
  const Vector6 inverse = estimate.scale.cwiseInverse();
  const auto null = estimate.null_directions.leftCols(estimate.null_count);
  Vector6 y = inverse.cwiseProduct(d);
  y -= null * (null.transpose() * y);
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(inverse.asDiagonal() * estimate.covariance *
                                                     inverse.asDiagonal());
  double sum = 0.0;
  for (int k = estimate.null_count; k < 6; ++k) {
    const double part = eigen.eigenvectors().col(k).dot(y);
    sum += part * part / eigen.eigenvalues()[k];
  }
  return sum;
}

}  // namespace assembly_cell
