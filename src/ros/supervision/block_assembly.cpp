// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/block_assembly.h"

#include <algorithm>
#include <iterator>

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::size_t kMemory = 500;  // incomplete blocks, and poses of the carrier

// stamp of the last sample
ros::Time endOf(const WrenchSamples& block) {
  return block.header.stamp +
         ros::Duration(block.period * (static_cast<double>(block.wrench.size() / 6) - 1.0));
}

}  // namespace

std::vector<BlockPart> partsOf(Sensors sensors) {
  if (sensors == Sensors::kB) return {kWrenchB, kDisplacementB, kCarrier};
  return {kWrenchA, kWrenchB, kDisplacementB, kCarrier};
}

void BlockAssembly::addWrench(BlockPart sensor, const WrenchSamples::ConstPtr& message) {
  blockOf(message->sequence).wrench[sensor] = message;
}

void BlockAssembly::addDisplacement(const DisplacementSamples::ConstPtr& message) {
  blockOf(message->sequence).displacement = message;
}

void BlockAssembly::addCarrier(const geometry_msgs::PoseStamped::ConstPtr& message) {
  carrier_poses_.push_back(message);
  if (carrier_poses_.size() > kMemory) carrier_poses_.pop_front();
}

// In order of arrival, whatever the sequence numbers are: those of a restarted source begin again.
// Blocks that stay incomplete are dropped first.
BlockMessages& BlockAssembly::blockOf(std::uint32_t sequence) {
  const auto known =
      std::find_if(blocks_.begin(), blocks_.end(),
                   [sequence](const BlockMessages& block) { return block.sequence == sequence; });
  if (known != blocks_.end()) return *known;
  if (blocks_.size() == kMemory) blocks_.pop_front();
  BlockMessages& block = blocks_.emplace_back();
  block.sequence = sequence;
  return block;
}

geometry_msgs::PoseStamped::ConstPtr BlockAssembly::carrierAtEndOf(
    const WrenchSamples& block) const {
  const ros::Time end = endOf(block);
  const ros::Duration tolerance(0.5 * block.period);
  geometry_msgs::PoseStamped::ConstPtr carrier;
  for (const auto& pose : carrier_poses_) {
    if (pose->header.stamp >= end - tolerance && pose->header.stamp <= end + tolerance) {
      carrier = pose;
    }
  }
  return carrier;
}

// But for the carrier's pose.
bool BlockAssembly::isComplete(const BlockMessages& block) const {
  const bool has_a = sensors_ == Sensors::kB || block.wrench[kWrenchA];
  return has_a && block.wrench[kWrenchB] && block.displacement;
}

std::optional<BlockMessages> BlockAssembly::take() {
  for (auto it = blocks_.begin(); it != blocks_.end(); ++it) {
    if (!isComplete(*it)) continue;
    it->carrier = carrierAtEndOf(*it->wrench[kWrenchB]);
    if (!it->carrier) continue;
    const BlockMessages complete = *it;
    blocks_.erase(blocks_.begin(), std::next(it));
    const ros::Time end = complete.carrier->header.stamp;
    while (!carrier_poses_.empty() && carrier_poses_.front()->header.stamp <= end) {
      carrier_poses_.pop_front();
    }
    // latched messages may arrive twice
    if (last_ == complete.sequence) return std::nullopt;
    last_ = complete.sequence;
    last_end_ = end;
    return complete;
  }
  return std::nullopt;
}

std::vector<BlockPart> BlockAssembly::missing() const {
  const bool has_samples = !blocks_.empty() && last_ != blocks_.back().sequence;
  const BlockMessages newest = has_samples ? blocks_.back() : BlockMessages{};
  const WrenchSamples::ConstPtr& wrench_b = newest.wrench[kWrenchB];
  const bool has_carrier =
      wrench_b ? carrierAtEndOf(*wrench_b) != nullptr
               : !carrier_poses_.empty() && carrier_poses_.back()->header.stamp > last_end_;
  std::vector<BlockPart> missing;
  if (!has_samples && !has_carrier) return missing;
  if (sensors_ == Sensors::kBoth && !newest.wrench[kWrenchA]) missing.push_back(kWrenchA);
  if (!wrench_b) missing.push_back(kWrenchB);
  if (!newest.displacement) missing.push_back(kDisplacementB);
  if (!has_carrier) missing.push_back(kCarrier);
  return missing;
}

void BlockAssembly::onPlantRestart() {
  last_.reset();
  last_end_ = ros::Time();
  carrier_poses_.clear();
}

}  // namespace assembly_cell::ros_bridge
