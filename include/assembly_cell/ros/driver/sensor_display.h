// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/WrenchStamped.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <cstdint>

#include "assembly_cell/ros/driver/driver_settings.h"
#include "assembly_cell/sensor/sensor_pipeline.h"

namespace assembly_cell::ros_bridge {

/// Averages of a sensor for displays: wrench, wrench_raw, wrench_with_covariance, displacement.
class SensorDisplay {
 public:
  /// settings is referred to.
  SensorDisplay(ros::NodeHandle& nh, std::uint32_t queue, const DriverSettings& settings);

  bool hasSubscribers() const;
  /// end: of the last block of the average.
  void publish(const SensorPipeline::Average& average, const ros::Time& end,
               const SensorPipeline& pipeline);

 private:
  void publishCovariances(const geometry_msgs::WrenchStamped& wrench, const Vector6& volts,
                          const Calibration& calibration);

  const DriverSettings& settings_;
  ros::Publisher wrench_raw_pub_, wrench_pub_, wrench_covariance_pub_, displacement_pub_;
};

}  // namespace assembly_cell::ros_bridge
