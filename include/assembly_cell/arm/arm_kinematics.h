// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

using JointVector = Eigen::VectorXd;  ///< joint positions, from the base on [rad] or [m]

struct JointLimits {
  JointVector lower, upper;  ///< [rad]; ±infinity for a continuous joint
  JointVector speed;         ///< [rad/s]
};

/// Result of the inverse kinematics.
struct JointSolution {
  bool reached = false;
  double distance = 0.0, turn = 0.0;  ///< error of position and rotation [m], [rad]
  int steps = 0;
  int at_limit = -1;  ///< index of a joint at its limit; -1: none
};

/// The joints of an arm's URDF from the root to the link `tip`: forward kinematics and Jacobian by
/// KDL, inverse kinematics by damped least squares. Not thread-safe.
class ArmKinematics {
 public:
  /// Throws InputError naming `source`: no URDF, no such link, joints that are neither revolute nor
  /// prismatic, no joint at all, or one without limits.
  ArmKinematics(const std::string& urdf, const std::string& tip, const std::string& source);
  ~ArmKinematics();

  int joints() const;
  const std::vector<std::string>& names() const;
  const std::string& base() const;  ///< root link
  const JointLimits& limits() const;

  /// Positions of the arm's joints from those of a message, in any order and among others. False if
  /// one of them is missing; `missing` is its name.
  bool select(const std::vector<std::string>& names, const std::vector<double>& positions,
              JointVector& q, std::string& missing) const;

  Pose forward(const JointVector& q) const;
  /// Twist of the tip (velocity, angular velocity; base axes) per joint rate. 6 × joints.
  const Eigen::Matrix<double, 6, Eigen::Dynamic>& jacobian(const JointVector& q) const;

  /// Inverse kinematics from `q` on, within the limits; the damping grows near a singularity. Where
  /// X can't be reached, q is the nearest solution found.
  JointSolution solve(const Pose& X, JointVector& q) const;
  /// Damped joint rates for the twist `v` of the tip; a joint at its limit only moves away from it.
  JointVector rates(const JointVector& q, const Vector6& v) const;
  /// One line with the first joint of q outside its limits, its position and its limits; empty:
  /// none. solve() moves such a joint to its limit.
  std::string beyondLimit(const JointVector& q) const;

 private:
  struct Chain;
  std::unique_ptr<Chain> chain_;
};

/// Is `frame` a link of the URDF whose frame is not that of the root link? False for other names:
/// the root may have another name on /tf.
bool isAwayFromRoot(const std::string& urdf, const std::string& frame);

}  // namespace assembly_cell
