// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/supervision/block_arrivals.h"
#include "assembly_cell/ros/supervision/block_decoder.h"
#include "assembly_cell/ros/supervision/goal_clock.h"

namespace assembly_cell::ros_bridge {

/// Blocks of the cell from kBlockTopics, one at a time: ready(), take(), last(). In lockstep a
/// block is acknowledged by acknowledge(), or at once while no strategy runs. Guarded by the
/// plant's monitor, which the callbacks lock.
class BlockStream {
 public:
  /// Called under the lock.
  struct Events {
    /// A block is ready for the strategy; the samples of sensor_b that it is of.
    std::function<void(const StreamBlock&, const WrenchSamples::ConstPtr&)> block;
    std::function<void()> plant_restart;  ///< stamps go back, in lockstep
    /// The node that publishes the carrier's pose, which is the plant, is another one.
    std::function<void(const std::string& node)> plant_node;
    std::function<void(Ack&)> acknowledge;  ///< sets `commands` and `session`
  };
  BlockStream(ros::NodeHandle& nh, const PlantSettings& settings, PlantMonitor& monitor,
              const Events& events);

  /// A strategy runs: blocks are decoded and wait for it.
  void setActive(bool active) { active_ = active; }
  /// Drops the block that is ready.
  void drop() { ready_.reset(); }
  /// Begins a goal: drops the blocks of an earlier one and sets it active. Requests the publishers
  /// from the master, so that their names need no response of it later. Releases the lock.
  void begin(PlantMonitor::Lock& lock);
  bool ready() const { return ready_.has_value(); }
  /// The ready block becomes last().
  void take();
  const StreamBlock& last() const { return last_; }
  /// In lockstep: the strategy has seen the latest block, once.
  void acknowledge();

  const BlockArrivals& arrivals() const { return arrivals_; }
  BlockDecoder& decoder() { return decoder_; }
  /// "sensor_b/wrench_samples of /sensor_b/driver", resolved. Releases the lock.
  std::string publisherOf(PlantMonitor::Lock& lock, BlockPart part);

  /// Which blocks a wait has been for.
  struct Silence {
    double patience;       ///< of the wait [s wall]
    double answer_within;  ///< time for a node to respond [s wall]
    bool is_over;          ///< name publishers that respond, too
    bool has_begun;        ///< the goal had blocks before
  };
  /// Publishers whose messages are missing, with their state; empty: none found. Releases the lock.
  std::string describeMissing(PlantMonitor::Lock& lock, const Silence& silence);

 private:
  struct Acknowledgement {
    std::optional<std::uint32_t> pending;  // sequence number of a block
    LatestPublisher<Ack> publisher;
  };

  void onMessage();

  const PlantSettings settings_;
  ros::NodeHandle nh_;
  PlantMonitor& monitor_;
  const Events events_;
  BlockAssembly assembly_;
  BlockArrivals arrivals_;
  BlockDecoder decoder_;
  bool active_ = false;
  std::optional<StreamBlock> ready_;
  StreamBlock last_;
  Acknowledgement ack_;
  std::array<StreamSubscriber, kBlockParts> subs_;  // last: callbacks use the rest
};

}  // namespace assembly_cell::ros_bridge
