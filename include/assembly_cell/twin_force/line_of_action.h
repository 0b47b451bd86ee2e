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

}  // namespace assembly_cell
