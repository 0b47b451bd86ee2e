// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/node_time.h"

#include <algorithm>
#include <chrono>

namespace assembly_cell {

NodeTime::NodeTime(bool lockstep, double real_time_factor)
    : lockstep_(lockstep), real_time_factor_(real_time_factor), clock_(!lockstep) {}

void NodeTime::observe(StampNs stamp) {
  last_ = stamp;
  clock_.observe(wall(), seconds(stamp));
}

double NodeTime::now() const {
  if (lockstep_) return last_ == 0 ? 0.0 : at(last_);
  return clock_.now(wall()) - seconds(epoch_);
}

StampNs NodeTime::stampAt(double time) const {
  return epoch_ + static_cast<StampNs>(std::max(0.0, time) * 1e9 + 0.5);
}

double NodeTime::wall() const {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return real_time_factor_ * std::chrono::duration<double>(now).count();
}

}  // namespace assembly_cell
