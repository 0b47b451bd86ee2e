// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <cstdint>
#include <optional>
#include <string>

#include "assembly_cell/arm/arm_settings.h"

namespace assembly_cell::ros_bridge {

/// Sends the points of the commanded motion in the terms of the arm's driver.
class ArmOutput {
 public:
  /// Topics are relative to `nh`. kinematics: of the arm, needed for joints.
  ArmOutput(ros::NodeHandle nh, const BridgeSettings& settings, const CellPlace& place,
            const ArmKinematics* kinematics);

  /// Present joints of the arm: the inverse kinematics of the next point starts there.
  void setJoints(const JointVector& q);
  /// Sends the point of `motion` for an arm at `measured`. Empty, or why the joints don't reach it:
  /// the nearest ones are sent.
  std::string send(const CommandMotion& motion, const Vector6& measured, const ros::Time& stamp);
  std::uint64_t sent() const { return sent_; }  ///< number of published points

 private:
  template <class Message>
  void publish(const Message& message);
  std::string sendJoints(const CommandMotion& motion, const ros::Time& stamp);
  void sendTwist(const CommandMotion& motion, const Vector6& measured, const ros::Time& stamp);

  const BridgeSettings settings_;
  const CellPlace place_;
  const ArmKinematics* kinematics_;
  std::uint64_t sent_ = 0;
  std::optional<JointVector> q_;             // sent last
  std::optional<Vector6> rest_;              // coordinates for which q_ is the solution from q_
  trajectory_msgs::JointTrajectory joints_;  // sent last
  ros::Publisher pub_;
};

}  // namespace assembly_cell::ros_bridge
