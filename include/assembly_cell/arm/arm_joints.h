// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_kinematics.h"

namespace assembly_cell {

/// Joint positions that an arm reports, and the pose of its flange for them.
class ArmJoints {
 public:
  /// kinematics: null for an arm that reports poses.
  explicit ArmJoints(std::unique_ptr<ArmKinematics> kinematics)
      : kinematics_(std::move(kinematics)) {}

  const ArmKinematics* kinematics() const { return kinematics_.get(); }
  /// From the names and positions of a message. False if a joint of the arm is missing: other
  /// joints of the same robot may be published in messages of their own.
  bool update(const std::vector<std::string>& names, const std::vector<double>& positions);

  const JointVector& positions() const { return q_; }  ///< empty before the first update
  const Pose& flange() const { return X_base_flange_; }
  /// See ArmKinematics::beyondLimit().
  const std::string& beyondLimit() const { return beyond_limit_; }

 private:
  std::unique_ptr<ArmKinematics> kinematics_;
  JointVector q_;
  Pose X_base_flange_;
  std::string beyond_limit_;
};

}  // namespace assembly_cell
