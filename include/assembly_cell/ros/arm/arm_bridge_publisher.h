// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/PlantState.h>
#include <ros/ros.h>
#include <std_msgs/Header.h>
#include <tf2_ros/transform_broadcaster.h>

#include <optional>
#include <string>

#include "assembly_cell/arm/arm_bridge.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/static_frames.h"

namespace assembly_cell::ros_bridge {

/// What arm_bridge publishes towards the cell: state of the plant, poses of the carrier, accepted
/// exciter commands, leases, answers in lockstep, diagnostics. Topics: docs/how_to/arm.md.
class ArmBridgePublisher {
 public:
  /// nh: of the cell; pnh: of the node.
  ArmBridgePublisher(ros::NodeHandle& nh, ros::NodeHandle& pnh, bool lockstep);
  /// Static frames, and from now on that of the carrier.
  void publishFrames(const CellPlace& place, const std::string& base_frame);

  /// Warns of a refused command, and counts it unless it is a lease.
  void refuse(const std::string& what, const std::string& node, const GuardVerdict& verdict);
  /// An accepted command to the exciter.
  void exciter(const Exciter& command);
  /// A block of sensor_b: its last contact wrench, and the bridge's lease for a simulator.
  void block(const std_msgs::Header& header, ArmBridge& bridge);
  /// What has changed: poses of the carrier, the exciter that the guard has switched off, the state
  /// of the plant.
  void changes(ArmBridge& bridge);
  /// Lockstep: the points of block `sequence` have been sent.
  void acknowledge(std::uint32_t sequence, const ArmBridge& bridge);
  /// `points`: sent so far. `stuck`: what a block in lockstep waits for; empty: for nothing.
  void diagnostics(ArmBridge& bridge, const std::string& flange, std::uint64_t points,
                   const std::string& stuck);
  /// Commands and exciter of the previous boot are forgotten.
  void restart();

 private:
  struct Refused {
    std::uint32_t count = 0;
    std::string node;
    GuardVerdict last;
  };
  void state(ArmBridge& bridge);

  const std::string name_, participant_;
  Refused refused_;
  std::optional<PlantState> published_;
  bool exciter_on_ = false;
  std::uint32_t exciter_count_ = 0;
  ros::Publisher carrier_pub_, plant_state_pub_, exciter_pub_, wrench_pub_, lease_pub_,
      diagnostics_pub_;
  LatestPublisher<Ack> ack_pub_;
  std::optional<tf2_ros::TransformBroadcaster> tf_;  // with frames
  StaticFrames static_tf_;
};

}  // namespace assembly_cell::ros_bridge
