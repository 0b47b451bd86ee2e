// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_settings.h"

namespace assembly_cell {

/// Node emulate_arm without ROS: an emulated arm that carries the carrier of a simulator, commanded
/// by joints, poses or twists. Times are cell time [s].
class ArmController {
 public:
  /// Throws InputError if the arm doesn't reach the carrier's start from `home`.
  ArmController(const EmulatedArmSettings& settings, const CellPlace& place,
                std::unique_ptr<ArmKinematics> kinematics);

  /// Carrier of the simulator, in carrier_base. The arm is placed there at the first pose, when the
  /// simulator was restarted, and when the carrier was moved by other means; true if it was. Where
  /// the arm doesn't reach it, it is placed as near as possible and `error` says so.
  bool setCarrier(const Pose& X, double time, bool restarted, std::string& error);
  bool isPlaced() const { return arm_.has_value(); }
  EmulatedArm& arm() { return *arm_; }
  const ArmKinematics& kinematics() const { return *kinematics_; }

  // Commands stamped `time`; the arm must be placed.
  /// Throws InputError if a joint of the arm is missing.
  void commandJoints(const std::vector<std::string>& names, const std::vector<double>& positions,
                     double time);
  void commandPose(const Pose& X_base_flange, double time);
  /// Twist of the flange in the arm's base. It is integrated until the next one, for 0.1 s at most.
  void commandTwist(const Vector6& twist, double time);

 private:
  const EmulatedArmSettings settings_;
  const CellPlace place_;
  std::unique_ptr<ArmKinematics> kinematics_;
  std::optional<EmulatedArm> arm_;
  JointVector wanted_;       // set point of poses and twists
  double twist_time_ = 0.0;  // of the last twist [s]
};

}  // namespace assembly_cell
