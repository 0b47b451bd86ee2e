// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Line of action of a wrench: its force along a line and a couple along the force.
struct LineOfAction {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();       ///< of the line, nearest to the origin [m]
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of the force, unit
  double force = 0.0;                                    ///< [N]
  double couple = 0.0;  ///< along direction; 0 for a point contact [N·m]
};
/// Empty for a zero or non-finite force.
std::optional<LineOfAction> lineOfAction(const Vector6& wrench);

/// Where the line meets the plane x_axis = height, with error (thesis 10.11–10.13 corrected: the
/// couple along the force is removed first, bounds add absolute values). With axis 2 and no couple
/// x1 = (x3 F1 − M2)/F3, x2 = (x3 F2 + M1)/F3.
struct LineCrossing {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();                          ///< in the plane [m]
  Eigen::Matrix<double, 3, 6> slope = Eigen::Matrix<double, 3, 6>::Zero();  ///< d point / d wrench
};
/// axis 0, 1 or 2. Empty where the line is parallel to the plane within 1e-9 rad.
std::optional<LineCrossing> lineCrossing(const Vector6& wrench, int axis, double height);

/// Largest error of the crossing for component errors up to |error|: Σ |slope| |error|. [m]
Eigen::Vector3d crossingBound(const LineCrossing& crossing, const Vector6& error);
/// Its covariance for a wrench covariance. [m²]
Eigen::Matrix3d crossingCovariance(const LineCrossing& crossing, const Matrix6& covariance);

/// Expected errors of a pose from two contacts (10.14 with its constants): 3-axis rms of position
/// 2.8 σ_M/F / sin²β [m] and of rotation 2.0 σ_F/F / sin β [rad]; β angle between the lines.
struct PoseErrorRule {
  double position = 0.0, rotation = 0.0;
};
PoseErrorRule poseErrorRule(double force, double sigma_force, double sigma_moment, double beta);

}  // namespace assembly_cell
