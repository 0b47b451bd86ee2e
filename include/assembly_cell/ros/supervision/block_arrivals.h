// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/ros/supervision/block_assembly.h"

namespace assembly_cell::ros_bridge {

/// When the messages of blocks arrived and which nodes publish them: what the age of a block and
/// missing publishers are found by. Not thread-safe.
class BlockArrivals {
 public:
  using Steady = std::chrono::steady_clock;

  BlockArrivals(bool lockstep, Sensors sensors) : sensors_(sensors), clock_(!lockstep) {}

  /// A message has arrived now. False: its publisher is the same as before.
  bool onMessage(BlockPart part, const std::string& publisher);
  /// The carrier's pose with this stamp was the message that arrived last.
  void onCarrierStamp(const ros::Time& stamp);
  /// A complete block has arrived now.
  void onBlock();

  /// May a block that ended at `end` lead to a command now?
  bool isFresh(const ros::Time& end) const;
  /// Messages that have been missing for longer than `limit` [s wall]. Only the carrier's pose
  /// where that is missing: without the plant no other publisher has anything to send.
  std::vector<BlockPart> silent(double limit) const;
  /// Node that published the latest message; empty: none yet.
  const std::string& publisher(BlockPart part) const { return publishers_[part]; }

  Steady::time_point lastBlock() const { return last_block_; }
  /// Since the latest complete block [s wall].
  double sinceBlock() const;
  /// Between complete blocks, the shorter of the last two intervals [s wall].
  double interval() const { return interval_; }

 private:
  Sensors sensors_;
  std::array<Steady::time_point, kBlockParts> arrived_{};
  std::array<std::string, kBlockParts> publishers_;
  CellClock clock_;
  Steady::time_point last_block_;
  double last_interval_ = 0.0, interval_ = 0.0;
};

}  // namespace assembly_cell::ros_bridge
