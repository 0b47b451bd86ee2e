// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/mechanism/sensors.h"

namespace assembly_cell::ros_bridge {

/// The messages of a block; indices of kBlockTopics.
enum BlockPart : std::size_t { kWrenchA, kWrenchB, kDisplacementB, kCarrier, kBlockParts };

/// Their topics, relative to the cell.
constexpr std::array<const char*, kBlockParts> kBlockTopics = {
    "sensor_a/wrench_samples", "sensor_b/wrench_samples", "sensor_b/displacement_samples",
    "carrier_pose"};

/// Parts of a block in a cell with these sensors.
std::vector<BlockPart> partsOf(Sensors sensors);

/// The messages of one block, complete or not.
struct BlockMessages {
  std::uint32_t sequence = 0;
  std::array<WrenchSamples::ConstPtr, 2> wrench;  ///< of sensor_a, if there is one, and sensor_b
  DisplacementSamples::ConstPtr displacement;     ///< of sensor_b
  geometry_msgs::PoseStamped::ConstPtr carrier;   ///< at the block's end
};

/// Joins the messages of a block: samples by their sequence number, the carrier's pose by its
/// stamp. They may arrive in any order, and blocks may be incomplete. Not thread-safe.
class BlockAssembly {
 public:
  explicit BlockAssembly(Sensors sensors) : sensors_(sensors) {}

  void addWrench(BlockPart sensor, const WrenchSamples::ConstPtr& message);
  void addDisplacement(const DisplacementSamples::ConstPtr& message);
  void addCarrier(const geometry_msgs::PoseStamped::ConstPtr& message);

  /// The oldest complete block, once. Blocks that began to arrive before it are dropped, and so is
  /// a repetition of the latest one. Nothing: none is complete.
  std::optional<BlockMessages> take();

  /// Messages that the newest block still needs; empty before its first one.
  std::vector<BlockPart> missing() const;

  /// End of the latest complete block; zero: none yet.
  ros::Time lastEnd() const { return last_end_; }

  /// The plant has been restarted: its clock and sequence numbers may begin again.
  void onPlantRestart();

 private:
  bool isComplete(const BlockMessages& block) const;
  BlockMessages& blockOf(std::uint32_t sequence);
  geometry_msgs::PoseStamped::ConstPtr carrierAtEndOf(const WrenchSamples& block) const;

  Sensors sensors_;
  std::deque<BlockMessages> blocks_;  // in the order of their first messages
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_poses_;  // after last_end_
  std::optional<std::uint32_t> last_;                               // sequence number
  ros::Time last_end_;
};

}  // namespace assembly_cell::ros_bridge
