// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/StrainSamples.h>
#include <ros/ros.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell::ros_bridge {

/// Averages windows of both sensors' strain in which nothing moves.
class StrainWindows {
 public:
  using Clock = std::chrono::steady_clock;
  using Seconds = std::chrono::duration<double>;

  struct Settings {
    PerSide<SensorDescription> sensor;
    std::size_t window = 200;           ///< samples
    Seconds settle_timeout{5.0};        ///< for a window in which nothing moves
    Seconds source_timeout{2.0};        ///< without a block a sensor counts as silent
    std::function<std::string()> stop;  ///< polled while waiting: empty, or why to give up
  };

  /// Subscribes to sensor_a/strain and sensor_b/strain of `nh`.
  StrainWindows(const ros::NodeHandle& nh, Settings settings);

  /// Attaches readings of a settled window of the sensors `wanted` to an observation. Samples count
  /// from `from` on, or (zero) those taken after the call. Returns why there is no window.
  CalibrationRefusal read(Observation& observation, const PerSide<bool>& wanted,
                          const ros::Time& from);

 private:
  /// Least time from a block's last stamp to its arrival, of the last 100 to 200 blocks: the
  /// difference of the clocks and the shortest way. A block that waited in a queue doesn't count.
  class Delay {
   public:
    void add(const ros::Duration& delay);
    /// None before the first block.
    std::optional<ros::Duration> shortest() const;

   private:
    std::optional<ros::Duration> earlier_, recent_;
    int count_ = 0;  // of `recent_`
  };

  /// Samples of one sensor during read().
  struct Collector {
    StreamSubscriber strain_sub;
    bool active = false;
    bool armed = false;  ///< `from` holds, or a block has come since the call
    bool restarted = false;
    ros::Time from;  ///< of the first sample that counts
    std::vector<Vector6> volts;
    std::vector<std::uint8_t> saturated;
    double first = 0.0, last = 0.0;  ///< stamps [s]
    double temperature = 0.0;        ///< of the last block [degC]
    std::optional<Clock::time_point> last_block;
    Delay delay;
    SequenceMonitor sequence;
  };

  void collect(Collector& collector, const StrainSamples& block);
  CalibrationRefusal fill(const PerSide<bool>& wanted, const ros::Time& from,
                          std::unique_lock<std::mutex>& lock);
  CalibrationRefusal giveUp(Side side, Clock::time_point begun) const;
  CalibrationRefusal evaluate(const PerSide<bool>& wanted,
                              PerSide<std::optional<Reading>>& readings);
  CalibrationRefusal unsettled(const Reading& reading, Side side) const;

  Settings settings_;
  std::mutex mutex_;
  std::condition_variable changed_;
  PerSide<Collector> collectors_;
};

}  // namespace assembly_cell::ros_bridge
