// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/line_of_action.h"

#include <Eigen/Geometry>
#include <cmath>

namespace assembly_cell {

using Eigen::Matrix3d;
using Eigen::Vector3d;

std::optional<LineOfAction> lineOfAction(const Vector6& wrench) {
  const Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  const double force = F.stableNorm();
  if (!(force > 0.0) || !wrench.allFinite()) return std::nullopt;
  LineOfAction line;
  line.direction = F / force;
  line.force = force;
  line.couple = line.direction.dot(M);
  line.point = line.direction.cross(M / force);
  return line;
}

std::optional<LineCrossing> lineCrossing(const Vector6& wrench, int axis, double height) {
  const auto line = lineOfAction(wrench);
  if (!line || axis < 0 || axis > 2 || !std::isfinite(height)) return std::nullopt;
  const Vector3d& u = line->direction;
  constexpr double kParallel = 1e-9;  // [rad]
  if (!(std::abs(u[axis]) > kParallel)) return std::nullopt;
  const double s = (height - line->point[axis]) / u[axis];
  LineCrossing out;
  out.point = line->point + s * u;
  out.point[axis] = height;

  // point = p0 + s u with p0 = F × M/F²; then the plane takes out the slide along u
  const Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  const double square = line->force * line->force;
  Eigen::Matrix<double, 3, 6> d_p0, d_u;
  d_p0 << (-skew(M) - 2.0 * line->point * F.transpose()) / square, skew(F) / square;
  d_u << (Matrix3d::Identity() - u * u.transpose()) / line->force, Matrix3d::Zero();
  const Eigen::Matrix<double, 3, 6> d_free = d_p0 + s * d_u;
  out.slope = d_free - u * d_free.row(axis) / u[axis];
  return out;
}

Vector3d crossingBound(const LineCrossing& crossing, const Vector6& error) {
  return crossing.slope.cwiseAbs() * error.cwiseAbs();
}

Matrix3d crossingCovariance(const LineCrossing& crossing, const Matrix6& covariance) {
  return crossing.slope * covariance * crossing.slope.transpose();
}

PoseErrorRule poseErrorRule(double force, double sigma_force, double sigma_moment, double beta) {
  const double sine = std::abs(std::sin(beta));
  return {2.8 * sigma_moment / force / (sine * sine), 2.0 * sigma_force / force / sine};
}

}  // namespace assembly_cell
