// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {

/// Candidate of the next contact: B at `move`, pressed along a line.
struct ContactCandidate {
  Pose move;                                        ///< X_Bb, relative to the estimate's reference
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the line, in axes of b [m]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< expected on B, axes of b [N]
  Matrix6 covariance_a = Matrix6::Identity();       ///< expected, as in TwinContact
  Matrix6 covariance_b = Matrix6::Identity();
  std::optional<Matrix6> move_covariance;
};

/// Predicted result of a candidate, at the estimate's pose.
struct ContactAdvice {
  int candidate = -1;                ///< index; −1: no candidates
  double smallest_eigenvalue = 0.0;  ///< smallest eigenvalue of Λ with the candidate
  double log_determinant = 0.0;      ///< log det Λ with the candidate; −∞ if still singular
  Matrix6 covariance =
      Matrix6::Zero();  ///< predicted, of δ, over the directions that are observable then
  double position_sd = 0.0, rotation_sd = 0.0;  ///< predicted, 3 axes; ∞ if still unobservable
};

/// The candidate with the largest smallest eigenvalue (equal within 1 %: largest log determinant).
/// Throws InputError for a candidate that is not finite or without force.
ContactAdvice adviseNextContact(const TwinForceEstimate& estimate,
                                const std::vector<ContactCandidate>& candidates,
                                const TwinForceOptions& options);

/// Candidates without a plan of reachable moves: at the reference pose, lines through the mean
/// point of the contacts' lines and 0.05 m beside it, along 13 directions (axes, diagonals), with
/// the contacts' mean force and covariances.
std::vector<ContactCandidate> defaultCandidates(const std::vector<TwinContact>& contacts);

}  // namespace assembly_cell
