// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

// Evaluation of an alignment's end from ground truth: poses of frame `peg` in `hole`.

/// Tilt of the peg's axis: smallest rotation from upright, rotation vector x, y [rad].
Eigen::Vector2d tiltOf(const Pose& X_HP);

/// Frame where the side of a peg begins whose bottom edge is chamfered up to a height [m]: the part
/// that has to be in the hole.
inline Pose shoulderPose(const Pose& X_HP, double chamfer_height) {
  return {X_HP.R, X_HP.p + chamfer_height * X_HP.R.col(2)};
}

/// Largest distance of the peg's bottom edge, or of its shoulder, from the hole's axis [m]; exact
/// to 1e-9 of the radius. bore_lean: of the axis, x and y per unit of height.
double edgeReach(const Pose& X_HP, double peg_radius,
                 const Eigen::Vector2d& bore_lean = Eigen::Vector2d::Zero());

/// Largest radial distance of the peg's edge from the bore's axis while the peg touches the wall
/// [m]. The viscous law lets it sink in, by u/rate where it comes at a speed u and by some
/// micrometres a second where it slides: by 0.1 mm or the clearance.
double reachInBore(double peg_radius, double hole_radius);

/// Greatest edgeReach() of an aligned peg [m]: the hole's radius, and 20 µm more where the whole
/// edge is 0.2 mm below the rim of the bore, so that only the wall can be beside it. chamfers:
/// height of the peg's chamfer plus depth of the hole's [m].
double greatestReach(const Pose& X_HP, double chamfers, double peg_radius, double hole_radius);

/// Whether a peg with this edgeReach() is in place, lengths in [m]. Depth 0: aligned, its edge is
/// in the hole. Otherwise inserted: it is in the bore, and the lowest point of its edge is no more
/// than 0.2 mm above the depth, within the errors of the measured plane and the carrier's
/// compliance. chamfers: as above.
bool inPlace(const Pose& X_HP, double chamfers, double edge_reach, double peg_radius,
             double hole_radius, double depth);

}  // namespace assembly_cell
