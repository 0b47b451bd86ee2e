// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/arm/arm_kinematics.h"

namespace assembly_cell {

/// Joint positions that an arm reports, and the pose of its flange for them. Its messages may have
/// other joints as well, whose values don't count, and other devices may use the same topic.
class ArmJoints {
 public:
  /// kinematics: null for an arm that reports poses.
  explicit ArmJoints(std::unique_ptr<ArmKinematics> kinematics)
      : kinematics_(std::move(kinematics)) {}

  const ArmKinematics* kinematics() const { return kinematics_.get(); }

  /// Joints of the arm that a message names.
  enum class Share { kNone, kSome, kAll };
  Share shareOf(const std::vector<std::string>& names) const;
  /// Names of the arm's joints that a message of `names` lacks, and its names that are like them
  /// (a prefix, another case): one line.
  std::string missing(const std::vector<std::string>& names) const;
  /// Number of the message's names that are like one of the arm's joints.
  std::size_t similar(const std::vector<std::string>& names) const;
  /// From the names and positions of a message that names all joints. Empty, or why it is refused:
  /// a position that is missing, not finite or beyond ±1000, a joint that is named twice.
  std::string update(const std::vector<std::string>& names, const std::vector<double>& positions);

  const JointVector& positions() const { return q_; }  ///< empty before the first update
  const Pose& flange() const { return X_base_flange_; }
  /// See ArmKinematics::beyondLimit().
  const std::string& beyondLimit() const { return beyond_limit_; }

 private:
  std::unique_ptr<ArmKinematics> kinematics_;
  JointVector q_, next_;
  Pose X_base_flange_;
  std::string beyond_limit_;
};

}  // namespace assembly_cell
