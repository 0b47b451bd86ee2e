// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/mechanism/sensors.h"

namespace assembly_cell {

/// Lockstep: a block is complete when the samples of all sensors have been received; commands wait
/// for its end.
class BlockBarrier {
 public:
  using Task = std::function<void()>;

  explicit BlockBarrier(Sensors sensors = Sensors::kBoth) : sensors_(sensors) {}

  /// Samples of a sensor (0: sensor_a, 1: sensor_b). False: received before.
  bool add(std::size_t sensor, std::uint32_t sequence);
  /// The block of all sensors that hasn't been finished; none: it isn't complete.
  std::optional<std::uint32_t> complete() const;
  bool isFinished(std::uint32_t sequence) const { return finished_ == sequence; }
  /// Ends a complete block; its tasks, in order.
  std::vector<Task> finish();
  /// True when no block has been finished since the last call, though samples have been received.
  bool isStuck();

  void defer(Task task) { tasks_.push_back(std::move(task)); }
  void deferFirst(Task task) { tasks_.insert(tasks_.begin(), std::move(task)); }
  /// The plant was restarted: sensor_b begins with this block, sensor_a may be ahead.
  void restart();

 private:
  Sensors sensors_;
  std::array<std::optional<std::uint32_t>, 2> sequence_;  // latest block of either sensor
  std::optional<std::uint32_t> finished_;
  std::vector<Task> tasks_;
  bool progress_ = false;  // since the last isStuck()
};

}  // namespace assembly_cell
