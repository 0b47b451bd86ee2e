// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Impact of one point with friction and energetic restitution.
#pragma once

#include <Eigen/Core>

#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

/// Impulse on a point that arrives with velocity v against the normal n; W: its velocity by a unit
/// of impulse. Coulomb friction along the impulse, v' = W (n − mu slip/|slip|), stick where it can
/// hold; the normal force gives back e² of the work it took in compression (Stronge 1990). Never
/// gives energy. [N s]
Eigen::Vector3d strongeImpulse(const Eigen::Matrix3d& W, const Eigen::Vector3d& n,
                               const Eigen::Vector3d& v, const FrictionParameters& friction,
                               double restitution);

}  // namespace assembly_cell
