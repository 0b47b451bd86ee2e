// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed-form estimates of the pose from terms: robust form, thesis form.
#pragma once

#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"
#include "likelihood.h"

namespace assembly_cell {
namespace twin_force {

/// Rotation from the SVD of the forces, with couple pairs for parallel lines, then the translation.
/// Unobservable directions keep their initial values; dropped directions are columns.
struct RobustSolution {
  Pose pose;
  Eigen::Matrix3d dropped =
      Eigen::Matrix3d::Zero();  ///< unit directions of T with their initial values
  int dropped_count = 0;
  bool turn_known = true;     ///< false: initial rotation about the common line
  bool couple_pairs = false;  ///< forces were parallel within kCouplePairs
  Eigen::Vector3d mean_axis;  ///< mean direction of the forces on A, unit
  double parallelism = 0.0;   ///< second over first singular value of the forces on A
  Eigen::Matrix3d
      turn_inverse;  ///< inverse of the rotation's normal matrix, observable directions only
  Eigen::Matrix3d shift_inverse;  ///< the same of the translation
};

/// used: indices of the terms.
RobustSolution solveRobust(const std::vector<Term>& terms, const std::vector<int>& used,
                           const Pose& start);

/// Translation for a given rotation; fills dropped, shift_inverse and pose.p.
void solveTranslation(const std::vector<Term>& terms, const std::vector<int>& used,
                      const Eigen::Vector3d& start, RobustSolution& out);

/// First-order covariance of the robust pose, over the observable directions.
Matrix6 robustCovariance(const std::vector<Term>& terms, const std::vector<int>& used,
                         const RobustSolution& solution);

/// Closed form of the thesis (10.3–10.6, 10.10) with the Gibbs matrix, from two contacts; `slope`
/// is d δ / d (w_A1, w_A2). False where |a2·b1| < 0.1 |a2||b1| or |F_A2·M1| < 0.1 |F_A2||M1|.
bool solveThesis(const Term& first, const Term& second, Pose& pose,
                 Eigen::Matrix<double, 6, 12>& slope);

}  // namespace twin_force
}  // namespace assembly_cell
