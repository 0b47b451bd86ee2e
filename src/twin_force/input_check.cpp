// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "input_check.h"

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

// maximum time between the two wrenches of a contact [s]
constexpr double kMaxDifferenceAtRest = 0.02, kMaxDifferenceMoving = 0.001;
constexpr double kAsymmetry = 1e-6;       // of sqrt(c_ii c_jj), rounding of printed numbers
constexpr double kSmallestPivot = 1e-12;  // of the diagonal entry
constexpr double kSkewed = 1e-6;  // largest entry of RᵀR − I, rounding of printed numbers

bool orthogonal(const Eigen::Matrix3d& R) {
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= kSkewed;
}

// Fault of a covariance, or null.
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
  // Cholesky decomposition; pivots relative to the diagonal entries
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
      // a component with zero variance has no correlations
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

// The name of a contact is composed for a message only.
template <typename Matrix>
void requireCovariance(const Matrix& c, bool semidefinite, const char* name, int contact = -1) {
  const char* fault = covarianceFault(c, semidefinite);
  if (fault == nullptr) return;
  const std::string of = contact < 0 ? "" : "contacts[" + std::to_string(contact) + "].";
  refuseCovariance(of + name, fault, semidefinite);
}

void requireErrors(const SensorErrors& e, const std::string& name) {
  for (const auto& [value, key] : {std::pair(e.gain, ".gain"), std::pair(e.rotation, ".rotation"),
                                   std::pair(e.offset, ".offset")}) {
    if (value >= 0.0 && std::isfinite(value)) continue;
    throw InputError(name + key + ": value " + yamlNumber(value) + ": give a finite number >= 0");
  }
  if (!(e.arm > 0.0 && std::isfinite(e.arm))) {
    throw InputError(name + ".arm: value " + yamlNumber(e.arm) + ": give a finite number > 0");
  }
  if (!e.frame.p.allFinite() || !e.frame.R.allFinite() || !orthogonal(e.frame.R)) {
    throw InputError(name + ": value not a pose: give a finite position and a unit quaternion");
  }
  constexpr int kEntries = 36;
  const Eigen::MatrixXd& gains = e.gain_covariance;
  if (gains.size() == 0) return;
  if (gains.rows() != kEntries || gains.cols() != kEntries) {
    throw InputError(name + ".gain_covariance: value " + std::to_string(gains.rows()) + " by " +
                     std::to_string(gains.cols()) + ": give 36 by 36");
  }
  const Eigen::Matrix<double, kEntries, kEntries> fixed = gains;
  if (const char* fault = covarianceFault(fixed, true)) {
    throw InputError(name + ".gain_covariance: value " + fault +
                     ": give a finite, symmetric, positive semidefinite covariance");
  }
}

void requirePositive(double value, const char* name) {
  if (value > 0.0 && std::isfinite(value)) return;
  throw InputError(std::string(name) + ": value " + yamlNumber(value) +
                   ": give a finite number > 0");
}

}  // namespace

namespace twin_force {

void checkInput(const std::vector<TwinContact>& contacts, const TwinForceOptions& options,
                std::size_t capacity) {
  if (contacts.size() > capacity) {
    throw InputError("contacts: value " + std::to_string(contacts.size()) +
                     " contacts: give at most " + std::to_string(capacity));
  }
  requirePositive(options.required_position, "required_position");
  requirePositive(options.required_rotation, "required_rotation");
  if (!(options.smallest_p >= 0.0 && options.smallest_p < 1.0)) {
    throw InputError("smallest_p: value " + yamlNumber(options.smallest_p) +
                     ": give a probability in [0, 1)");
  }
  int n = 0;
  for (const TwinContact& c : contacts) {
    requireCovariance(c.covariance_a, false, "covariance_a", n);
    requireCovariance(c.covariance_b, false, "covariance_b", n);
    if (c.move_covariance) requireCovariance(*c.move_covariance, true, "move_covariance", n);
    ++n;
  }
  if (options.prior) {
    requireCovariance(options.prior->covariance, false, "prior.covariance");
    const Pose& pose = options.prior->pose;
    if (!pose.p.allFinite() || !pose.R.allFinite() || !orthogonal(pose.R)) {
      throw InputError("prior: value not a pose: give a finite position and a unit quaternion");
    }
  }
  if (options.tare_covariance) requireCovariance(*options.tare_covariance, true, "tare_covariance");
  if (options.errors) {
    requireErrors(options.errors->a, "errors.sensor_a");
    requireErrors(options.errors->b, "errors.sensor_b");
  }
}

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
    if (!orthogonal(c.move.R) || c.move.R.determinant() < 0.0) {
      return Refusal{"a move's rotation is not a rotation", n};
    }
    if (c.saturated) return Refusal{"a sensor was saturated", n};
    if (c.tare_age > options.oldest_tare) return Refusal{"the tare is older than its limit", n};
    const double limit = c.moving ? kMaxDifferenceMoving : kMaxDifferenceAtRest;
    if (std::abs(c.time_difference) > limit) {
      return Refusal{"the two wrenches are not simultaneous", n};
    }
  }
  return std::nullopt;
}

}  // namespace twin_force

void checkCovariance(const Matrix6& covariance, const std::string& name, bool semidefinite) {
  if (const char* fault = covarianceFault(covariance, semidefinite)) {
    refuseCovariance(name, fault, semidefinite);
  }
}

}  // namespace assembly_cell
