// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "assembly_cell/arm/arm_joints.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

/// Takes the arm's state from the messages of its driver. Messages without the arm's joints, or in
/// another frame, are not the arm's: other devices may use the same topic. Not thread-safe.
class ArmInput {
 public:
  struct State {
    Pose X_base_flange;
    ros::Time stamp;
  };

  /// topic: resolved name, for the log. base_frame: of poses. kinematics: null for an arm that
  /// reports poses.
  ArmInput(const std::string& topic, const std::string& base_frame,
           std::unique_ptr<ArmKinematics> kinematics);

  /// None: the message isn't taken, see refusal().
  std::optional<State> take(const ros::MessageEvent<sensor_msgs::JointState const>& event);
  std::optional<State> take(const ros::MessageEvent<geometry_msgs::PoseStamped const>& event);
  /// Why the last message was refused, and until the first state of the arm also what those of
  /// other devices lack; empty: nothing to report.
  const std::string& refusal() const { return refusal_; }
  const ArmJoints& joints() const { return joints_; }

 private:
  template <class Message>
  std::optional<State> accept(const ros::MessageEvent<Message const>& event);
  void refuse(const std::string& publisher, const std::string& why);

  const std::string topic_, base_frame_;
  ArmJoints joints_;
  StreamFilter filter_;
  bool received_ = false;    // a state of the arm
  std::size_t similar_ = 0;  // names like the arm's in the message of `refusal_`
  std::string refusal_;
};

}  // namespace assembly_cell::ros_bridge
