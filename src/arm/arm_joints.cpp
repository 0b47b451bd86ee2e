// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_joints.h"

namespace assembly_cell {

bool ArmJoints::update(const std::vector<std::string>& names,
                       const std::vector<double>& positions) {
  JointVector q;
  std::string missing;
  if (!kinematics_->select(names, positions, q, missing)) return false;
  // an arm at rest reports the same again
  if (q.size() == q_.size() && q == q_) return true;
  q_ = q;
  X_base_flange_ = kinematics_->forward(q);
  beyond_limit_ = kinematics_->beyondLimit(q);
  return true;
}

}  // namespace assembly_cell
