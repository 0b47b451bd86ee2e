// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The two Rodrigues vectors of thesis chapters 10 and 11 as two types, and lines crossing planes
// (10.11–10.14): what the estimators' closed forms are compared with.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "assembly_cell/twin_force/line_of_action.h"

namespace assembly_cell {

/// g = tan(θ/2) n, the vector of thesis 10.3–10.5. Infinite at θ = π.
struct GibbsVector {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
};

/// (λ, μ, ν) = 2 tan(θ/2) n of thesis 10.7 and 11.3: twice the Gibbs vector. Infinite at θ = π.
struct RodriguesVector {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
};

/// R = I + 2/(1 + g·g) ([g] + [g]²).
inline Eigen::Matrix3d rotationFromGibbs(const GibbsVector& g) {
  const Eigen::Matrix3d cross = skew(g.value);
  return Eigen::Matrix3d::Identity() +
         2.0 / (1.0 + g.value.squaredNorm()) * (cross + cross * cross);
}

/// R = I + ([λ] + ½[λ]²)/(1 + ¼ λ·λ), thesis 10.7.
inline Eigen::Matrix3d rotationFromRodrigues(const RodriguesVector& lambda) {
  const Eigen::Matrix3d cross = skew(lambda.value);
  return Eigen::Matrix3d::Identity() +
         (cross + 0.5 * cross * cross) / (1.0 + 0.25 * lambda.value.squaredNorm());
}

/// Inverses, exact at θ = 0; throw within 1e-8 rad of θ = π, where they are infinite.
inline GibbsVector gibbsFromRotation(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  // |w| = cos θ/2, half the distance of θ from π
  if (!(std::abs(q.w()) > 0.5e-8)) throw std::domain_error("half a turn");
  return {q.vec() / q.w()};
}
inline RodriguesVector rodriguesFromRotation(const Eigen::Matrix3d& R) {
  return {2.0 * gibbsFromRotation(R).value};
}

/// Where the line meets the plane x_axis = height, with error (thesis 10.11–10.13 corrected: the
/// couple along the force is removed first, bounds add absolute values). With axis 2 and no couple
/// x1 = (x3 F1 − M2)/F3, x2 = (x3 F2 + M1)/F3.
struct LineCrossing {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();                          ///< in the plane [m]
  Eigen::Matrix<double, 3, 6> slope = Eigen::Matrix<double, 3, 6>::Zero();  ///< d point / d wrench
};
/// axis 0, 1 or 2. Empty where the line is parallel to the plane within 1e-9 rad.
inline std::optional<LineCrossing> lineCrossing(const Vector6& wrench, int axis, double height) {
  using Eigen::Vector3d;
  const auto line = lineOfAction(wrench);
  if (!line) return std::nullopt;
  const Vector3d& u = line->direction;
  if (!(std::abs(u[axis]) > 1e-9)) return std::nullopt;
  const double s = (height - line->point[axis]) / u[axis];
  LineCrossing out;
  out.point = line->point + s * u;
  out.point[axis] = height;

  // point = p0 + s u with p0 = F × M/F²; then the plane takes out the slide along u
  const Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  const double square = line->force * line->force;
  Eigen::Matrix<double, 3, 6> d_p0, d_u;
  d_p0 << (-skew(M) - 2.0 * line->point * F.transpose()) / square, skew(F) / square;
  d_u << (Eigen::Matrix3d::Identity() - u * u.transpose()) / line->force, Eigen::Matrix3d::Zero();
  const Eigen::Matrix<double, 3, 6> d_free = d_p0 + s * d_u;
  out.slope = d_free - u * d_free.row(axis) / u[axis];
  return out;
}

/// Largest error of the crossing for component errors up to |error|: Σ |slope| |error|. [m]
inline Eigen::Vector3d crossingBound(const LineCrossing& crossing, const Vector6& error) {
  return crossing.slope.cwiseAbs() * error.cwiseAbs();
}
/// Its covariance for a wrench covariance. [m²]
inline Eigen::Matrix3d crossingCovariance(const LineCrossing& crossing, const Matrix6& covariance) {
  return crossing.slope * covariance * crossing.slope.transpose();
}

/// Expected errors of a pose from two contacts (10.14 with its constants): 3-axis rms of position
/// 2.8 σ_M/F / sin²β [m] and of rotation 2.0 σ_F/F / sin β [rad]; β angle between the lines.
struct PoseErrorRule {
  double position = 0.0, rotation = 0.0;
};
inline PoseErrorRule poseErrorRule(double force, double sigma_force, double sigma_moment,
                                   double beta) {
  const double sine = std::abs(std::sin(beta));
  return {2.8 * sigma_moment / force / (sine * sine), 2.0 * sigma_force / force / sine};
}

}  // namespace assembly_cell
