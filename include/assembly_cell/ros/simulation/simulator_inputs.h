// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <set>
#include <string>

#include "assembly_cell/CarrierMotion.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/Lease.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/simulation/lockstep_answers.h"
#include "assembly_cell/ros/simulation/simulator_state.h"

namespace assembly_cell::ros_bridge {

/// Leases, commands and motions of the carrier as they arrive: converted once, they go to the
/// CommandGate, and commands are counted for the lockstep.
class SimulatorInputs {
 public:
  /// All are referred to.
  SimulatorInputs(ros::NodeHandle& nh, const SimulatorSettings& settings, SimulatorState& state,
                  LockstepAnswers& answers);

 private:
  void onCarrierCommand(const ros::MessageEvent<geometry_msgs::PoseStamped const>& event);
  void onExciter(const ros::MessageEvent<Exciter const>& event);
  void onLease(const ros::MessageEvent<Lease const>& event);
  void onCarrierMotion(const CarrierMotion& motion);

  void findEarlierPublishers(const ros::NodeHandle& nh);
  template <class Message>
  Sender senderOf(const ros::MessageEvent<Message const>& event, const char* topic);
  /// Is it a command that is no repetition? One from an earlier boot isn't counted: its sender
  /// counts from the start again.
  template <class Message>
  bool accept(const Sender& sender, const char* topic, const Message& message);

  SimulatorState& state_;
  LockstepAnswers& answers_;
  std::set<std::string> earlier_publishers_;  // topic and node, before this one started
  ros::Subscriber command_sub_, exciter_sub_, lease_sub_;
  StreamSubscriber motion_sub_;
};

}  // namespace assembly_cell::ros_bridge
