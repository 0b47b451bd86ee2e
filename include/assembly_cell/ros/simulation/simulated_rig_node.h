// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/ApplyLoad.h>
#include <ros/ros.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/calibration/two_sensor/rig.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct RigNodeSettings {
  RigSettings rig;                ///< its sample_period follows from rate
  std::string coupling;           ///< file whose coupling sensor_b is; empty: its own hinges
  double rate = 5000.0;           ///< of the samples [Hz]
  int block_size = 100;           ///< samples in a block
  double real_time_factor = 1.0;  ///< seconds of samples per second of the wall clock

  RigNodeSettings();
};
void fields(FieldList& f, RigNodeSettings& s);

/// The simulated calibration bench: two sensors whose ground truth is not published, masses, dial
/// gauges. Publishes the strain of both under the load last applied. Interfaces:
/// docs/reference/interfaces.md.
class SimulatedRigNode {
 public:
  /// Threads of its callbacks.
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
  RigNodeSettings settings_;

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
