// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/block_arrivals.h"

#include <algorithm>
#include <utility>

namespace assembly_cell::ros_bridge {

namespace {

template <class Duration>
double seconds(const Duration& duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

bool BlockArrivals::onMessage(BlockPart part, const std::string& publisher) {
  arrived_[part] = Steady::now();
  return std::exchange(publishers_[part], publisher) != publisher;
}

void BlockArrivals::onCarrierStamp(const ros::Time& stamp) {
  clock_.observe(seconds(arrived_[kCarrier].time_since_epoch()), stamp.toSec());
}

void BlockArrivals::onBlock() {
  const auto now = Steady::now();
  const double interval = seconds(now - last_block_);
  interval_ = std::min(interval, last_interval_);
  last_interval_ = interval;
  last_block_ = now;
}

bool BlockArrivals::isFresh(const ros::Time& end) const {
  return assembly_cell::isFresh(end.toSec(), clock_.now(seconds(Steady::now().time_since_epoch())));
}

std::vector<BlockPart> BlockArrivals::silent(double limit) const {
  const auto now = Steady::now();
  const auto is_silent = [&](BlockPart part) { return seconds(now - arrived_[part]) > limit; };
  if (is_silent(kCarrier)) return {kCarrier};
  std::vector<BlockPart> out;
  for (const BlockPart part : partsOf(sensors_)) {
    if (is_silent(part)) out.push_back(part);
  }
  return out;
}

double BlockArrivals::sinceBlock() const { return seconds(Steady::now() - last_block_); }

}  // namespace assembly_cell::ros_bridge
