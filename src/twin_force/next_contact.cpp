// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/next_contact.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/twin_force/line_of_action.h"
#include "likelihood.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Relative difference up to which smallest eigenvalues count as equal: contacts mirrored at the
// plane of the others differ by rounding and noise. Half or twice: `align` locates the hole to 3.9
// or 4.0 µm, here 3.8.
constexpr double kEqual = 0.01;
constexpr double kBeside = 0.05;  // lateral offset of default candidates, a typical arm [m]

void checkCandidate(const ContactCandidate& c, std::size_t i) {
  const std::string name = "candidates[" + std::to_string(i) + "]";
  if (!c.point.allFinite() || !c.force.allFinite() || !c.move.p.allFinite() ||
      !c.move.R.allFinite()) {
    throw InputError(name +
                     ": value not finite: give a move, a point and a force of finite numbers");
  }
  if (!(c.force.norm() > 0.0)) {
    throw InputError(name + ".force: value zero: give the expected force on B");
  }
}

ContactAdvice predict(const Matrix6& information, const TwinForceOptions& options) {
  Vector6 s;
  s << Vector3d::Constant(options.required_position), Vector3d::Constant(options.required_rotation);
  const Matrix6 scaled = s.asDiagonal() * information * s.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scaled);
  ContactAdvice out;
  out.smallest_eigenvalue = std::max(0.0, eigen.eigenvalues()[0]);
  bool seen[2] = {true, true};
  for (int k = 0; k < 6; ++k) {
    const double value = eigen.eigenvalues()[k];
    const Vector6 v = s.cwiseProduct(eigen.eigenvectors().col(k));
    if (value < twin_force::kUnobservable) {
      out.log_determinant = -std::numeric_limits<double>::infinity();
      if (eigen.eigenvectors().col(k).head<3>().norm() > 1e-6) seen[0] = false;
      if (eigen.eigenvectors().col(k).tail<3>().norm() > 1e-6) seen[1] = false;
      continue;
    }
    out.log_determinant += std::log(value);
    out.covariance += v * v.transpose() / value;
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  out.position_sd = seen[0] ? std::sqrt(out.covariance.topLeftCorner<3, 3>().trace()) : kInfinity;
  out.rotation_sd =
      seen[1] ? std::sqrt(out.covariance.bottomRightCorner<3, 3>().trace()) : kInfinity;
  return out;
}

// Information JᵀC⁻¹J of a candidate at the estimate's pose. Errors of the sensors are those of the
// earlier contacts: their part that depends on the pose changes J, the rest is noise of this
// contact.
Matrix6 candidateInformation(const ContactCandidate& candidate, const TwinForceEstimate& estimate,
                             const TwinForceOptions& options, const twin_force::ErrorRoots& roots) {
  const Pose& X_AB = estimate.pose;
  TwinContact c;
  c.wrench_b << candidate.force, candidate.point.cross(candidate.force);
  c.wrench_a = -transformWrench(X_AB * candidate.move, c.wrench_b);
  c.covariance_a = candidate.covariance_a;
  c.covariance_b = candidate.covariance_b;
  c.move = candidate.move;
  c.move_covariance = candidate.move_covariance;
  const twin_force::Term term = twin_force::makeTerm(c);
  Matrix6 J = twin_force::wrenchJacobian(X_AB.R * term.F_B, X_AB.R * term.M_B, X_AB.p);
  Matrix6 C = twin_force::residualCovariance(term, X_AB);
  if (options.errors && estimate.error_slope.size() > 0) {
    const Eigen::Matrix<double, 6, Eigen::Dynamic> J_u = twin_force::errorJacobian(
        twin_force::errorColumns(*options.errors, roots, c.wrench_a, c.wrench_b), c.move, X_AB);
    J -= J_u * estimate.error_slope;
    C += J_u * estimate.error_rest * J_u.transpose();
  }
  return J.transpose() * C.llt().solve(J);
}

}  // namespace

ContactAdvice adviseNextContact(const TwinForceEstimate& estimate,
                                const std::vector<ContactCandidate>& candidates,
                                const TwinForceOptions& options) {
  ContactAdvice best;
  const twin_force::ErrorRoots roots =
      options.errors ? twin_force::errorRoots(options) : twin_force::ErrorRoots();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    checkCandidate(candidates[i], i);
    ContactAdvice advice = predict(
        estimate.information + candidateInformation(candidates[i], estimate, options, roots),
        options);
    advice.candidate = static_cast<int>(i);
    const double ratio = advice.smallest_eigenvalue - best.smallest_eigenvalue;
    const double margin = kEqual * best.smallest_eigenvalue;
    if (best.candidate < 0 || ratio > margin ||
        (ratio > -margin && advice.log_determinant > best.log_determinant)) {
      best = advice;
    }
  }
  return best;
}

std::vector<ContactCandidate> defaultCandidates(const std::vector<TwinContact>& contacts) {
  // mean line point, force and covariances of the contacts
  ContactCandidate mean;
  mean.covariance_a.setZero();
  mean.covariance_b.setZero();
  double force = 0.0, count = 0.0;
  for (const TwinContact& c : contacts) {
    const Vector6 w_B = transformWrench(c.move, c.wrench_b);
    const auto line = lineOfAction(w_B);
    if (!line) continue;
    mean.point += line->point;
    force += line->force;
    mean.covariance_a += c.covariance_a;
    mean.covariance_b += c.covariance_b;
    count += 1.0;
  }
  std::vector<ContactCandidate> out;
  if (count == 0.0) return out;
  mean.point /= count;
  force /= count;
  mean.covariance_a /= count;
  mean.covariance_b /= count;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        // one of each pair of opposite directions
        if (x * 9 + y * 3 + z <= 0) continue;
        ContactCandidate c = mean;
        const Vector3d u = Vector3d(x, y, z).normalized();
        c.force = force * u;
        out.push_back(c);
        const Vector3d side = u.unitOrthogonal();
        c.point = mean.point + kBeside * side;
        out.push_back(c);
        c.point = mean.point + kBeside * u.cross(side);
        out.push_back(c);
      }
    }
  }
  return out;
}

}  // namespace assembly_cell
