// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <cstdint>

#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/driver/sensor_display.h"
#include "assembly_cell/ros/driver/sensor_state.h"

namespace assembly_cell::ros_bridge {

/// The data path of a driver: a block of strain goes through the core's SensorPipeline, and its
/// wrenches and displacements are published.
class SensorOutput {
 public:
  /// queue: of the topics, 0: unlimited. All are referred to.
  SensorOutput(const ros::NodeHandle& nh, std::uint32_t queue, const DriverSettings& settings,
               const LiveSettings& live, SensorState& state);

  void advertiseStrain();
  bool hasStrain() const { return static_cast<bool>(strain_pub_); }
  /// Do wrenches have a subscriber?
  bool hasSubscribers() const;
  /// Are all subscribers connected that the master has for strain and wrench_samples? It is asked
  /// over the network.
  bool allConnected() const;

  /// Locks the state.
  void process(const StrainSamples::ConstPtr& block);
  /// Latched; with the state locked.
  void publishBias();
  void publishCalibration();

 private:
  void processLocked(const StrainSamples::ConstPtr& block);
  void publishDisplacement(const SensorSamples& strain, const WrenchSamples& wrench);

  ros::NodeHandle nh_;
  const std::uint32_t queue_;
  const DriverSettings& settings_;
  const LiveSettings& live_;
  SensorState& state_;
  WrenchSamples::ConstPtr last_wrench_;              // published
  DisplacementSamples::ConstPtr last_displacement_;  // published
  int repetitions_ = 0;                              // of the last block
  SensorDisplay display_;
  ros::Publisher strain_pub_, bias_pub_, calibration_pub_;
  LatestPublisher<WrenchSamples> wrench_samples_pub_;
  LatestPublisher<DisplacementSamples> displacement_samples_pub_;
};

}  // namespace assembly_cell::ros_bridge
