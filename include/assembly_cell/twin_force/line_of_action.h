// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Line of action of a wrench: its force along a line and a couple along the force.
struct LineOfAction {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< point of the line nearest to the origin [m]
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< direction of the force, unit
  double force = 0.0;                                    ///< [N]
  double couple = 0.0;  ///< along direction; 0 for a point contact [N·m]
};
/// Empty for a zero or non-finite force.
std::optional<LineOfAction> lineOfAction(const Vector6& wrench);

/// Line of action and pitch of a wrench, for one contact point without a model of the part.
struct ContactLine {
  LineOfAction line;
  /// Couple over force F·M/F² [m]: 0 for a point contact with any position and friction.
  double pitch = 0.0, pitch_sd = 0.0;
  /// Intersection of the line with the plane z = height of the wrench's axes [m]; infinite if
  /// parallel.
  Eigen::Vector2d cut = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cut_covariance = Eigen::Matrix2d::Zero();
};
/// covariance: of the wrench; height [m]. Empty for a zero or non-finite force.
std::optional<ContactLine> contactLine(const Vector6& wrench, const Matrix6& covariance,
                                       double height);

}  // namespace assembly_cell
