// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

using JointVector = Eigen::VectorXd;  ///< one a joint, from the base on [rad] or [m]

struct JointLimits {
  JointVector lower, upper;  ///< [rad]; of a continuous joint ±infinity
  JointVector speed;         ///< [rad/s]
};

/// How a search for joint positions ended.
struct JointSolution {
  bool reached = false;
  double distance = 0.0, turn = 0.0;  ///< from the pose asked for [m], [rad]
  int steps = 0;
  int at_limit = -1;  ///< a joint that stands at its limit; -1: none
};

/// An arm's joints as its URDF has them, from the root to the link `tip`: forward kinematics and
/// Jacobian by KDL, inverse kinematics by damped least squares from where the arm is. Not
/// thread-safe.
class ArmKinematics {
 public:
  /// Throws InputError naming `source`: no URDF, no such link, joints that neither turn nor slide,
  /// none at all, or one without limits.
  ArmKinematics(const std::string& urdf, const std::string& tip, const std::string& source);
  ~ArmKinematics();

  int joints() const;
  const std::vector<std::string>& names() const;
  const std::string& base() const;  ///< root link
  const JointLimits& limits() const;

  Pose forward(const JointVector& q) const;
  /// Rates of the tip (velocity, angular velocity; base axes) by those of the joints. 6 × joints.
  const Eigen::Matrix<double, 6, Eigen::Dynamic>& jacobian(const JointVector& q) const;

  /// Joint positions whose tip is at X, from `q` on and within the limits: the near solution, the
  /// damping grows as a singularity comes near. Where X can't be reached q is as near as it got.
  JointSolution solve(const Pose& X, JointVector& q) const;
  /// Joint rates that give the tip the rates `v` as well as the damping allows; of joints at their
  /// limits only those that lead away.
  JointVector rates(const JointVector& q, const Vector6& v) const;

 private:
  struct Chain;
  std::unique_ptr<Chain> chain_;
};

}  // namespace assembly_cell
