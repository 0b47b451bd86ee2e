// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Robust form on prepared contacts.
#pragma once

#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"
#include "likelihood.h"

namespace assembly_cell {
namespace twin_force {

/// Robust pose with what its covariance needs.
struct RobustSolution {
  RobustPose result;
  Eigen::Vector3d mean_axis;      ///< of the forces on A, unit
  double parallelism = 0.0;       ///< second over first singular value of the forces on A
  Eigen::Matrix3d turn_inverse;   ///< of the rotation's normal matrix, known directions only
  Eigen::Matrix3d shift_inverse;  ///< of the translation's
};

/// `used` lists the terms.
RobustSolution solveRobust(const std::vector<Term>& terms, const std::vector<int>& used,
                           const Pose& start);

/// Translation for a given rotation; fills dropped, shift_inverse and pose.p.
void solveTranslation(const std::vector<Term>& terms, const std::vector<int>& used,
                      const Eigen::Vector3d& start, RobustSolution& out);

/// First-order covariance of the robust pose, over the known directions.
Matrix6 robustCovariance(const std::vector<Term>& terms, const std::vector<int>& used,
                         const RobustSolution& solution);

/// Thesis form from two terms; `slope`, if given, gets d δ / d (w_A1, w_A2).
bool solveThesis(const Term& first, const Term& second, Pose& pose,
                 Eigen::Matrix<double, 6, 12>* slope = nullptr);

}  // namespace twin_force
}  // namespace assembly_cell
