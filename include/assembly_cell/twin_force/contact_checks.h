// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {

enum class SignVerdict { kRight, kReversed, kUndecided };

/// Start-up check of the signs of both sensors, from one press along a known direction.
struct SignCheck {
  SignVerdict a = SignVerdict::kUndecided;  ///< wrench_a against −R_AB times the expected force
  SignVerdict b = SignVerdict::kUndecided;  ///< wrench_b against the expected force
  SignVerdict pair = SignVerdict::kUndecided;  ///< of the two relative to each other, without an
                                               ///< expected direction
};
/// R_AB: nominal orientation, within 90° of the true one. force_on_b: expected direction of the
/// force on B in axes of b, any length; zero if unknown. Undecided below 20 sd of force or more
/// than 45° from both verdicts.
SignCheck checkSigns(const TwinContact& contact, const Eigen::Matrix3d& R_AB,
                     const Eigen::Vector3d& force_on_b);

/// Sign of the pair without a nominal orientation, from three contacts or more whose forces are not
/// coplanar: the determinant of the forces changes sign from B to A exactly if the signs are right.
/// Undecided for fewer or (nearly) coplanar forces, below 3 sd of the determinant.
SignVerdict checkSigns(const std::vector<TwinContact>& contacts);

}  // namespace assembly_cell
