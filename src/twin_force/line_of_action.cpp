// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/line_of_action.h"

#include <Eigen/Geometry>
#include <cmath>

namespace assembly_cell {

std::optional<LineOfAction> lineOfAction(const Vector6& wrench) {
  const Eigen::Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  const double force = F.stableNorm();
  if (!(force > 0.0) || !wrench.allFinite()) return std::nullopt;
  LineOfAction line;
  line.direction = F / force;
  line.force = force;
  line.couple = line.direction.dot(M);
  line.point = line.direction.cross(M / force);
  return line;
}

std::optional<ContactLine> contactLine(const Vector6& wrench, const Matrix6& covariance,
                                       double height) {
  const auto line = lineOfAction(wrench);
  if (!line) return std::nullopt;
  const Eigen::Vector3d F = wrench.head<3>(), M = wrench.tail<3>();
  ContactLine out;
  out.line = *line;
  const double force2 = line->force * line->force;
  out.pitch = line->couple / line->force;
  using Row = Eigen::Matrix<double, 1, 6>;
  Row dpitch;
  dpitch << ((M - 2.0 * out.pitch * F) / force2).transpose(), (F / force2).transpose();
  out.pitch_sd = std::sqrt(dpitch * covariance * dpitch.transpose());
  // (x, y, height) × F = M − pitch F
  out.cut.x() = (height * F.x() - M.y() + out.pitch * F.y()) / F.z();
  out.cut.y() = (height * F.y() + M.x() - out.pitch * F.x()) / F.z();
  Eigen::Matrix<double, 2, 6> slope;
  slope.row(0) = F.y() * dpitch;
  slope.row(1) = -F.x() * dpitch;
  slope(0, 0) += height;
  slope(0, 1) += out.pitch;
  slope(0, 2) -= out.cut.x();
  slope(0, 4) -= 1.0;
  slope(1, 0) -= out.pitch;
  slope(1, 1) += height;
  slope(1, 2) -= out.cut.y();
  slope(1, 3) += 1.0;
  slope /= F.z();
  out.cut_covariance = slope * covariance * slope.transpose();
  return out;
}

}  // namespace assembly_cell
