// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <memory>
#include <optional>
#include <string>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/arm/command_motion.h"

namespace assembly_cell::ros_bridge {

/// How an arm is told where to go.
enum class ArmInterface {
  kPose,   ///< geometry_msgs/PoseStamped of the flange on target_frame
  kTwist,  ///< geometry_msgs/TwistStamped of the flange on twist
  kJoints  ///< trajectory_msgs/JointTrajectory of one point on command
};
/// pose, twist or joints.
ArmInterface armInterface(const std::string& name);

/// Sends an arm the points of its way, in the terms that its driver takes.
class ArmOutput {
 public:
  struct Settings {
    ArmInterface interface = ArmInterface::kJoints;
    CellPlace place;
    std::string base_frame;   ///< of poses and twists
    double twist_gain = 5.0;  ///< of the way that is left, in twists [1/s]
  };
  /// Topics are relative to `nh`. kinematics: of the arm, needed for joints.
  ArmOutput(ros::NodeHandle nh, const Settings& settings, const ArmKinematics* kinematics);

  /// Where the arm's joints are: the search for the next ones begins there.
  void setJoints(const JointVector& q);
  /// The point of `motion`, for an arm that says it is at `measured`. Empty, or why its joints
  /// can't: they are sent as near as they get.
  std::string send(const CommandMotion& motion, const Vector6& measured, const ros::Time& stamp);

 private:
  std::string sendJoints(const CommandMotion& motion, const ros::Time& stamp);
  void sendTwist(const CommandMotion& motion, const Vector6& measured, const ros::Time& stamp);

  Settings settings_;
  const ArmKinematics* kinematics_;
  std::optional<JointVector> q_;  // sent last
  std::optional<Vector6> rest_;   // the carrier there, if these joints lead nearest to it
  trajectory_msgs::JointTrajectory joints_;  // that
  ros::Publisher pub_;
};

}  // namespace assembly_cell::ros_bridge
