// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>

namespace assembly_cell {

/// Impulse of one point with Coulomb friction and Stronge's energetic coefficient: the normal force
/// gives back restitution² of the work it takes while the point approaches. `mobility`: velocity of
/// the point by a unit impulse at it [1/kg]; `velocity`: of the point, approaching along `normal`;
/// friction of slip and of rest. Stronge, Impact Mechanics, chapters 3 and 4. To 1e-12 of itself.
Eigen::Vector3d energeticImpulse(const Eigen::Matrix3d& mobility, const Eigen::Vector3d& normal,
                                 const Eigen::Vector3d& velocity, double sliding_friction,
                                 double static_friction, double restitution);

}  // namespace assembly_cell
