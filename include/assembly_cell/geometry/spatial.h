// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace assembly_cell {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Rigid pose X_AB of frame B in frame A: p_A = R_AB p_B + p_AB. [m]
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< R_AB, columns are B's axes seen in A
  Eigen::Vector3d p = Eigen::Vector3d::Zero();      ///< p_AB, origin of B in A [m]
};

// Compiled once, in spatial.cpp: inlined they would cost each file that includes this half a second
// of compiling.

/// X_AC = X_AB X_BC.
Pose operator*(const Pose& X_AB, const Pose& X_BC);

/// X_BA from X_AB.
Pose inverse(const Pose& X_AB);

/// The matrix [v] with [v] u = v × u.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Wrench (force, torque) about A's origin in A's axes from the same wrench about B's origin in B's
/// axes. Includes the lever arm, which tf2's own transform of wrenches leaves out:
/// f_A = R f_B, t_A = R t_B + p × R f_B. [N], [N·m]
Vector6 transformWrench(const Pose& X_AB, const Vector6& w_B);

/// The 6×6 matrix Φ(X_AB) with transformWrench(X_AB, w) = Φ w.
Matrix6 wrenchTransform(const Pose& X_AB);

/// Euler angles of the thesis (z-y-z about its axes x1 up, x2, x3). Upright: phi = 0, theta = π/2.
/// For scenario files and printing only. [rad]
struct EulerAngles {
  double phi = 0.0;
  double theta = 1.5707963267948966;
  double psi = 0.0;
};

/// R_HP = Ry(phi) Rx(theta − π/2) Rz(psi) in the axes of frame `hole` (z up). Thesis eq. 6.1.
Eigen::Matrix3d rotationFromEuler(const EulerAngles& angles);

/// Inverse of rotationFromEuler, with theta in (0, π). At the singularity (peg horizontal along y)
/// phi is set to 0.
EulerAngles eulerFromRotation(const Eigen::Matrix3d& R_HP);

/// Rotation vector θ n [rad]; a type of its own, not to be mixed with the two Rodrigues vectors.
struct RotationVector {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
};
Eigen::Matrix3d rotationFromVector(const RotationVector& v);
RotationVector vectorFromRotation(const Eigen::Matrix3d& R);

}  // namespace assembly_cell
