// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/spatial.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {

Pose operator*(const Pose& X_AB, const Pose& X_BC) {
  return {X_AB.R * X_BC.R, X_AB.R * X_BC.p + X_AB.p};
}

Pose inverse(const Pose& X_AB) { return {X_AB.R.transpose(), -(X_AB.R.transpose() * X_AB.p)}; }

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Vector6 transformWrench(const Pose& X_AB, const Vector6& w_B) {
  Vector6 w_A;
  w_A.head<3>() = X_AB.R * w_B.head<3>();
  w_A.tail<3>() = X_AB.R * w_B.tail<3>() + X_AB.p.cross(w_A.head<3>());
  return w_A;
}

Matrix6 wrenchTransform(const Pose& X_AB) {
  Matrix6 phi = Matrix6::Zero();
  phi.topLeftCorner<3, 3>() = X_AB.R;
  phi.bottomRightCorner<3, 3>() = X_AB.R;
  phi.bottomLeftCorner<3, 3>() = skew(X_AB.p) * X_AB.R;
  return phi;
}

Eigen::Matrix3d rotationFromEuler(const EulerAngles& angles) {
  constexpr double half_pi = 1.5707963267948966;
  return (Eigen::AngleAxisd(angles.phi, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles.theta - half_pi, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(angles.psi, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

EulerAngles eulerFromRotation(const Eigen::Matrix3d& R) {
  // peg axis z in hole axes: (sin phi sin theta, cos theta, cos phi sin theta)
  EulerAngles angles;
  angles.theta = std::atan2(std::hypot(R(0, 2), R(2, 2)), R(1, 2));
  if (std::hypot(R(0, 2), R(2, 2)) < 1e-12) {
    angles.phi = 0.0;
  } else {
    angles.phi = std::atan2(R(0, 2), R(2, 2));
  }
  // the remainder after phi and theta is the rotation about the peg's axis
  EulerAngles tilt = angles;
  tilt.psi = 0.0;
  const Eigen::Matrix3d rest = rotationFromEuler(tilt).transpose() * R;
  angles.psi = std::atan2(rest(1, 0), rest(0, 0));
  return angles;
}

Eigen::Matrix3d rotationFromVector(const RotationVector& v) {
  const double angle = v.value.norm();
  // below 1e-8 the quadratic term is below rounding
  if (angle < 1e-8) return Eigen::Matrix3d::Identity() + skew(v.value);
  return Eigen::AngleAxisd(angle, v.value / angle).toRotationMatrix();
}

RotationVector vectorFromRotation(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  const double s = q.vec().norm();
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  if (s < 1e-10) return {2.0 * sign * q.vec()};
  return {q.vec() * (sign * 2.0 * std::atan2(s, std::abs(q.w())) / s)};
}

}  // namespace assembly_cell
