// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "assembly_cell/ros/driver/block_stamper.h"
#include "assembly_cell/ros/driver/sensor_output.h"
#include "assembly_cell/ros/driver/sensor_state.h"
#include "assembly_cell/ros/driver/source_choice.h"
#include "assembly_cell/ros/process/ros_clock.h"
#include "assembly_cell/sensor/acquisition.h"

namespace assembly_cell::ros_bridge {

/// Is it a recording that is played as fast as it's read?
inline bool isFast(const SourceInfo& info) { return info.recorded && !info.paced; }

/// Blocks of a StrainSource (device, recording, plug-in) as messages: one thread reads the source,
/// another one stamps and processes the blocks.
class SourceReader {
 public:
  /// Opens a recording. source_timeout: silence after which a device is opened again [s]. Throws
  /// InputError, SourceError.
  SourceReader(SourceChoice choice, const SourceSettings& settings, double source_timeout,
               SensorState& state);
  ~SourceReader() { stop(); }

  /// From now on blocks go to `output`, which is referred to.
  void start(SensorOutput& output, const std::string& frame_id);
  void stop();

  StrainSource& source() const { return *choice_.source; }
  const std::string& type() const { return choice_.type; }
  Acquisition& acquisition() const { return *acquisition_; }
  /// A recording has been played.
  bool ended() const { return ended_; }

  struct Timing {
    Delays delays;  ///< from the arrival of a block's last sample to its publication
    std::uint64_t clock_steps = 0;
    double last_clock_step = 0.0;  ///< [s]
  };
  Timing timing() const;

 private:
  void publishAll();
  void publish(const SourceBlock& block);
  void logLink();  ///< each cause of a lost link once
  /// Checks what is known only once the source is open; false if it can't work.
  bool beginStream();

  SourceChoice choice_;
  const SourceSettings settings_;
  SensorState& state_;
  SensorOutput* output_ = nullptr;
  std::string frame_id_;
  std::unique_ptr<Acquisition> acquisition_;
  std::optional<BlockStamper> stamper_;
  std::atomic<bool> ended_{false};
  std::string logged_cause_;
  mutable std::mutex timing_mutex_;
  Delays delays_;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
