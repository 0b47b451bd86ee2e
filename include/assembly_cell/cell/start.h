// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

/// A start for studies: the same mechanism with the peg hanging `height` over the plane (lowest
/// edge point), its bottom centre off by offset [m] and its axis tilted by the rotation vector
/// [rad].
Scenario startAt(const Scenario& scenario, const Eigen::Vector2d& offset,
                 const Eigen::Vector2d& tilt, double height);

/// Base of the carrier in `hole`, X_HB: where the rest pose starts, tilt included, yaw 0. The
/// carrier's pose is commanded and reported in it, so that it does not reveal the hole's position.
Pose carrierBase(const Scenario& scenario);

}  // namespace assembly_cell
