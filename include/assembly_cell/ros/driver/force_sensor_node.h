// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/driver/sensor_diagnostics.h"
#include "assembly_cell/ros/driver/sensor_output.h"
#include "assembly_cell/ros/driver/sensor_services.h"
#include "assembly_cell/ros/driver/sensor_state.h"
#include "assembly_cell/ros/driver/source_reader.h"

namespace assembly_cell::ros_bridge {

class Parameters;

/// Driver of one six-axis sensor: blocks of samples, from the topic `bridge` or from a StrainSource
/// (device, recording, plug-in), become wrenches and displacements (sensor/sensor_pipeline.h).
/// Interfaces: docs/reference/interfaces.md.
class ForceSensorNode {
 public:
  /// Threads of the callbacks of the data path; the services have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or file.
  ForceSensorNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~ForceSensorNode();

 private:
  std::string cellNamespace() const;  ///< one above the sensor's
  void readParameters();
  void openSource(SourceChoice choice, Parameters& parameters);
  void loadCalibrationFile();
  /// Does the source deliver volts, as far as that is known before it is open?
  bool deliversVolts() const;
  void subscribe();
  void refuseBlock(const StrainSamples& block, const std::string& why);
  void acknowledge(const StrainSamples& block);

  ros::NodeHandle nh_, pnh_;
  DriverSettings settings_;
  SourceSettings source_settings_;
  SensorState state_;
  std::string source_;  // for people
  std::unique_ptr<LiveSettings> live_;
  std::unique_ptr<SourceReader> reader_;  // null: blocks come on a topic
  std::unique_ptr<SensorOutput> output_;
  std::unique_ptr<SensorServices> services_;
  std::unique_ptr<SensorDiagnostics> diagnostics_;
  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber bridge_sub_;
};

}  // namespace assembly_cell::ros_bridge
