// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/SensorCalibration.h>
#include <ros/ros.h>
#include <std_msgs/String.h>

#include <mutex>

#include "assembly_cell/calibration/two_sensor/session.h"

namespace assembly_cell::ros_bridge {

/// Topics of calibration_server: status, observations and the active calibration of each sensor.
class CalibrationTopics {
 public:
  /// Advertises below `pnh` and publishes calibrations and status once.
  CalibrationTopics(ros::NodeHandle pnh, const CalibrationSession& session);

  /// Status, and (to subscribers) the observation file.
  void publishStatus(bool in_action);
  /// Calibrations that became active just now.
  void publishCalibrations(const PerSide<bool>& changed);
  /// `c` with the time since which the sensor's calibration is active.
  SensorCalibration messageOf(Side side, const Calibration& c) const;

 private:
  std_msgs::String observationsMessage() const;

  const CalibrationSession& session_;
  mutable std::mutex mutex_;  ///< guards active_since_
  PerSide<ros::Time> active_since_;
  PerSide<ros::Publisher> calibration_pub_;
  ros::Publisher status_pub_, observations_pub_;
};

}  // namespace assembly_cell::ros_bridge
