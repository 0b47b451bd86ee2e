// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <string>

#include "assembly_cell/calibration/two_sensor/session.h"

namespace assembly_cell::ros_bridge {

/// The calibrations in the sensors' drivers: services SENSOR/driver/get_calibration and
/// set_calibration.
class CalibrationDrivers {
 public:
  /// `enabled` false: the drivers are neither read nor set.
  CalibrationDrivers(const ros::NodeHandle& nh, bool enabled, PerSide<std::string> serial_numbers);

  /// Calibrations in the drivers of the sensors wanted; empty where a driver is missing or has one
  /// of another serial number.
  PerSide<Calibration> current(const PerSide<bool>& wanted) const;

  /// Sends calibrations; returns "; …" for each driver that is missing or refuses. With `before`
  /// (see current()) a refusal restores those already sent and throws CalibrationError.
  std::string send(const MaybePerSide<ActiveCalibration>& calibrations,
                   const PerSide<Calibration>* before) const;

 private:
  ros::NodeHandle nh_;
  bool enabled_;
  PerSide<std::string> serial_numbers_;
};

}  // namespace assembly_cell::ros_bridge
