// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Impact of one point with friction and energetic restitution.
#pragma once

#include <Eigen/Core>

#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

/// Impulse [N s] of a collision with energetic restitution (Stronge 1990). v: velocity of the point
/// [m/s], v·n < 0; n: unit normal; W: its inverse inertia [1/kg]. Along the normal impulse p,
/// Coulomb friction: dv/dp = W (n − mu slip/|slip|), stick where friction suffices. The work of the
/// normal force in restitution is e² times that in compression. The kinetic energy never increases.
Eigen::Vector3d strongeImpulse(const Eigen::Matrix3d& W, const Eigen::Vector3d& n,
                               const Eigen::Vector3d& v, const FrictionParameters& friction,
                               double restitution);

}  // namespace assembly_cell
