// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <assembly_cell/WrenchSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/arm/arm_controller.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/process/periodic_thread.h"

namespace assembly_cell::ros_bridge {

/// Node emulate_arm: an emulated arm with the topics of an arm's driver, see arm/arm_controller.h.
/// It carries the carrier of a simulator with ~follow_motion. Without lockstep its controller runs
/// by the cell time that the simulator's messages give; in lockstep it answers each block of
/// sensor_b, and each command runs it to the command's stamp. See docs/how_to/arm.md.
class EmulatedArmNode {
 public:
  /// Threads for its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  EmulatedArmNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void subscribe(ros::NodeHandle& arm_nh, ArmInterface interface);
  void onSimulated(const geometry_msgs::PoseStamped& pose);
  void onWrench(const WrenchSamples& samples);

  // with the mutex locked
  template <class Message, class Command>
  void take(const Message& message, const Command& command);
  void setLoad(const WrenchSamples& samples);
  void runUntil(double time);
  void publish(double time);

  ros::NodeHandle nh_;
  const std::string participant_;
  bool lockstep_ = false;
  std::mutex mutex_;
  std::unique_ptr<ArmController> controller_;
  std::unique_ptr<NodeTime> time_;
  StampNs simulated_ = 0;               // stamp of the simulator's last pose
  std::optional<WrenchSamples> early_;  // a block received before the arm was placed
  ros::Publisher joints_pub_, pose_pub_, motion_pub_;
  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber simulated_sub_, wrench_sub_, command_sub_;
  ros::ServiceServer unlock_srv_;
  PeriodicThread thread_;  // last: uses the other members
};

}  // namespace assembly_cell::ros_bridge
