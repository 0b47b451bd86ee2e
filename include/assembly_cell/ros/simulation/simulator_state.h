// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <atomic>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>

#include "assembly_cell/cell/command_gate.h"

namespace assembly_cell::ros_bridge {

/// What the parts of the simulator share. `mutex` guards all that is below it.
struct SimulatorState {
  SimulatorState(const PlantGuard& guard, const ros::Time& start) : epoch(start), gate(guard) {}

  const ros::Time epoch;            ///< stamp of node time 0
  std::atomic<double> now{0.0};     ///< node time at the last block's end [s]
  std::condition_variable changed;  ///< what the loop waits for

  std::mutex mutex;
  CommandGate gate;
  bool quit = false;
  bool paused = false;
  std::string stopped;  ///< why the simulation can't go on; empty while it can

  /// Stamp of a node time [s].
  ros::Time stampOf(double time) const {
    ros::Time stamp;
    stamp.fromNSec(epoch.toNSec() +
                   static_cast<std::uint64_t>(static_cast<std::int64_t>(std::llround(time * 1e9))));
    return stamp;
  }
  /// Node time of a stamp, any stamp [s].
  double timeOf(const ros::Time& stamp) const {
    // differences of ros::Time throw where they are large
    return 1e-9 * static_cast<double>(static_cast<std::int64_t>(stamp.toNSec()) -
                                      static_cast<std::int64_t>(epoch.toNSec()));
  }
};

/// Writes a line of the guard to the log, if there is one.
void warn(const std::string& line);
/// Warns at most once a second.
void warnThrottled(const std::string& line);

}  // namespace assembly_cell::ros_bridge
