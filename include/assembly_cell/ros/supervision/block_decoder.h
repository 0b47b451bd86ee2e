// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "assembly_cell/align/estimation/block_pipeline.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/ros/supervision/block_assembly.h"
#include "assembly_cell/ros/supervision/plant_monitor.h"

namespace assembly_cell::ros_bridge {

/// A block in the core's terms. Its time on a plant clock isn't set.
struct StreamBlock {
  std::uint32_t sequence = 0;
  ros::Time end;                            ///< of its last sample
  Pose X_BC;                                ///< carrier in its base, at the end
  PlantBlock means;                         ///< all but `time` and readings
  std::array<std::uint8_t, 2> saturated{};  ///< channels of sensor_a and sensor_b, a bit each
};

/// Detects a channel that stays at its limit for longer than any press of a strategy.
class SaturationCheck {
 public:
  void clear() { *this = SaturationCheck(); }
  /// One line without the sensor's name if it is saturated by now: "channels 1, 3 at their limit in
  /// every block for 0.5 s". sensor: 0 of sensor_a, 1 of sensor_b.
  std::optional<std::string> add(const StreamBlock& block, std::size_t sensor);

 private:
  /// Consecutive blocks with a channel at its limit.
  struct Run {
    int blocks = 0;
    std::uint8_t channels = 0;  // all of them, a bit each
    ros::Time since;            // end of the first block
  };
  std::array<Run, 2> runs_;
};

/// Converts the messages of blocks; subscribes to the calibrations that this needs. Guarded by the
/// plant's monitor.
class BlockDecoder {
 public:
  /// converter_step: of both sensors [V].
  BlockDecoder(ros::NodeHandle& nh, double converter_step, Sensors sensors, PlantMonitor& monitor);

  /// The calibrations of all sensors have arrived.
  bool hasCalibrations() const { return pipeline_.calibrated(); }
  /// Throws PlantError if both are of one sensor.
  void checkCalibrations() const;
  /// Displacements follow from the wrench by this coupling; null: those of the driver.
  void setCoupling(const CouplingParameters* coupling) { pipeline_.setCoupling(coupling); }

  /// Nothing if the samples aren't finite or the pose is none.
  std::optional<StreamBlock> decode(const BlockMessages& messages) const;

 private:
  Sensors sensors_;
  BlockPipeline pipeline_;
  std::array<ros::Subscriber, 2> calibration_subs_;  // of sensor_a and sensor_b
};

}  // namespace assembly_cell::ros_bridge
