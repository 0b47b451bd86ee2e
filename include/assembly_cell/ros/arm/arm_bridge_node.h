// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/WrenchSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/arm/block_barrier.h"
#include "assembly_cell/ros/arm/arm_bridge_publisher.h"
#include "assembly_cell/ros/arm/arm_input.h"
#include "assembly_cell/ros/arm/arm_output.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/ros/process/periodic_thread.h"

namespace assembly_cell::ros_bridge {

/// Parameters of arm_bridge, and the files that they name.
struct ArmBridgeSettings {
  /// Throws InputError for a bad parameter, file or robot description.
  explicit ArmBridgeSettings(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);

  BridgeSettings bridge;
  CellPlace place;
  Payload payload;
  ArmGuard guard;
  std::unique_ptr<ArmKinematics> kinematics;  ///< null for an arm that reports poses
  bool lockstep = false;
  double real_time_factor = 1.0;  ///< cell time per wall-clock time of a simulation
  std::vector<std::string> participants;
};

/// Node arm_bridge: the plant of a cell whose carrier is on an arm. Receives carrier_command,
/// exciter and leases, sends the arm a point each period, and publishes its pose; limits and
/// watchdog are those of arm/arm_guard.h, the logic that of arm/arm_bridge.h. By the wall clock one
/// thread handles the received messages and computes the points; in lockstep a block's points
/// follow when all participants have answered it. See docs/how_to/arm.md.
class ArmBridgeNode {
 public:
  /// Threads for its callbacks: one keeps commands, blocks and states in order.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  ArmBridgeNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void advertise(ros::NodeHandle& pnh);
  void subscribe();  ///< also again, when the lockstep is stuck
  void onCarrierCommand(const ros::MessageEvent<geometry_msgs::PoseStamped const>& event);
  void onExciter(const ros::MessageEvent<Exciter const>& event);
  void onAck(const ros::MessageEvent<Ack const>& event);
  void onWrench(std::size_t sensor, const WrenchSamples& samples);

  // with the mutex locked
  template <class Message>
  void onState(const ros::MessageEvent<Message const>& event);
  void renew(const std::string& node, StampNs stamp, std::uint32_t session);
  void take(BlockBarrier::Task task);  ///< now, or in lockstep at the block's end
  void endBlock();
  std::string awaited();  ///< what the present block waits for; empty: for nothing
  void point(double time);

  struct Connections {
    std::vector<ros::Subscriber> subscribers;
    std::vector<StreamSubscriber> streams;
    std::vector<ros::ServiceServer> servers;
    std::vector<ros::WallTimer> timers;
    std::string stuck;  // in lockstep: what the block waited for at the last check
  };
  ros::CallbackQueue queue_;  // of the points' thread
  ros::NodeHandle nh_;
  ArmBridgeSettings settings_;
  std::mutex mutex_;
  ArmBridge bridge_;
  ArmInput input_;
  std::unique_ptr<ArmOutput> output_;
  std::unique_ptr<ArmBridgePublisher> publisher_;
  BlockBarrier barrier_;
  Participants participants_;
  Connections connections_;
  PeriodicThread thread_;  // last: uses the other members
};

}  // namespace assembly_cell::ros_bridge
