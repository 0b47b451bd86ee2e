// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

// What the judge of an alignment looks at: true poses of frame `peg` in `hole`.

/// Tilt of the peg's axis: smallest rotation from upright, rotation vector x, y [rad].
Eigen::Vector2d tiltOf(const Pose& X_HP);

/// Largest distance of the peg's bottom edge from the hole's axis [m]; exact to 1e-9 of the radius.
/// bore_lean: of the axis, x and y per unit of height.
double edgeReach(const Pose& X_HP, double peg_radius,
                 const Eigen::Vector2d& bore_lean = Eigen::Vector2d::Zero());

/// The peg's whole bottom edge lies within the hole's cylinder.
inline bool edgeInside(const Pose& X_HP, double peg_radius, double hole_radius,
                       const Eigen::Vector2d& bore_lean = Eigen::Vector2d::Zero()) {
  return edgeReach(X_HP, peg_radius, bore_lean) <= hole_radius;
}

}  // namespace assembly_cell
