// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <cstdint>
#include <string>

#include "assembly_cell/ros/driver/sensor_state.h"
#include "assembly_cell/ros/driver/source_reader.h"

namespace assembly_cell::ros_bridge {

/// The diagnostics of a driver: samples, device (with a source of its own) and calibration.
class SensorDiagnostics {
 public:
  /// source: for people, where blocks come from. reader: null if they come on a topic. The others
  /// are referred to.
  SensorDiagnostics(ros::NodeHandle& nh, const ros::NodeHandle& pnh, const DriverSettings& settings,
                    const std::string& source, SensorState& state, const SourceReader* reader);

 private:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;

  double expectedRate() const;
  void diagnoseSamples(Status& status);
  void diagnoseFrozen(Status& status);
  void diagnoseDevice(Status& status);
  void diagnoseCalibration(Status& status);

  const DriverSettings& settings_;
  const std::string source_;
  SensorState& state_;
  const SourceReader* const reader_;
  // at the last report
  SourceCounters reported_counters_;
  LinkStatus reported_link_;
  std::uint64_t reported_steps_ = 0;
  bool reported_frozen_ = false, reported_fault_ = false, reported_takeover_ = false;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::ros_bridge
