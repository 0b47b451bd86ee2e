// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/ros/driver/driver_settings.h"
#include "assembly_cell/sensor/sensor_pipeline.h"

namespace assembly_cell::ros_bridge {

/// What the parts of a driver share: its data path, services and diagnostics. `mutex` guards all
/// that is below it.
struct SensorState {
  using Clock = std::chrono::steady_clock;

  std::condition_variable changed;  ///< a block was processed, a zero failed, or the node ends
  std::atomic<bool> stopping{false};
  const Clock::time_point started = Clock::now();

  std::mutex mutex;
  SensorPipeline pipeline;
  CalibrationRules rules;
  ros::Time calibration_time;                   ///< since when it has been active
  std::optional<ros::Time> bias_time;           ///< none: not set
  std::optional<Clock::time_point> last_block;  ///< its arrival
  bool recorded = false;  ///< the source is a recording: played as it is, also where it is frozen
  std::string foreign_frame;  ///< of blocks of another sensor since the last report
};

}  // namespace assembly_cell::ros_bridge
