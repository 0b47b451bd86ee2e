// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/block_poses.h"

#include <algorithm>
#include <iterator>

#include "assembly_cell/arm/command_motion.h"
#include "assembly_cell/arm/node_time.h"

namespace assembly_cell {
namespace {

constexpr double kMemory = 1.0;          // of states [s]
constexpr std::size_t kMaxBlocks = 100;  // without a state

}  // namespace

void BlockPoses::addBlock(double end) {
  ends_.push_back(end);
  if (ends_.size() > kMaxBlocks) ends_.pop_front();
}

void BlockPoses::addState(double time, const Vector6& coordinates) {
  // the arm's clock was set back
  if (!states_.empty() && time < states_.back().time) states_.clear();
  states_.push_back({time, coordinates});
  while (time - states_.front().time > kMemory) states_.pop_front();
}

std::optional<BlockPoses::BlockPose> BlockPoses::next() {
  if (ends_.empty() || states_.empty()) return std::nullopt;
  const double end = ends_.front();
  if (states_.back().time < end - kStampRounding) return std::nullopt;
  ends_.pop_front();
  const auto after = std::find_if(states_.begin(), states_.end(), [&](const State& state) {
    return state.time >= end - kStampRounding;
  });
  Vector6 x = after->coordinates;
  const double ahead = after->time - end;
  if (after != states_.begin() && ahead > kStampRounding) {
    const State& before = *std::prev(after);
    x += ahead / (after->time - before.time) * (before.coordinates - after->coordinates);
  }
  return BlockPose{end, poseOfCoordinates(x)};
}

}  // namespace assembly_cell
