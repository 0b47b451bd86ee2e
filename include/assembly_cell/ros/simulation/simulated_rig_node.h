// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/ApplyLoad.h>
#include <ros/ros.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>

#include "assembly_cell/calibration/two_sensor/rig.h"

namespace assembly_cell::ros_bridge {

/// The simulated calibration bench: two sensors whose ground truth is not published, masses, dial
/// gauges. Publishes the strain of both under the load last applied. Interfaces:
/// docs/reference/interfaces.md.
class SimulatedRigNode {
 public:
  /// Of its callbacks.
  static constexpr unsigned kThreads = 2;

  /// Throws InputError for a bad parameter.
  SimulatedRigNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);

 private:
  using Clock = std::chrono::steady_clock;

  void publishDueBlocks();
  void publishBlock();
  bool apply(ApplyLoad::Request& request, ApplyLoad::Response& response);
  ros::Time stampOf(std::uint64_t sample) const;

  ros::NodeHandle nh_, pnh_;
  RigSettings settings_;
  double speed_ = 1.0;  // samples' time per wall clock
  int block_size_ = 100;

  std::mutex mutex_;
  std::unique_ptr<CalibrationRig> rig_;
  ros::Time start_;  // of the samples' time base
  Clock::time_point wall_start_;
  std::uint64_t samples_ = 0;  // given so far
  std::uint32_t sequence_ = 0;

  PerSide<ros::Publisher> bridge_pub_;
  ros::ServiceServer apply_srv_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::ros_bridge
