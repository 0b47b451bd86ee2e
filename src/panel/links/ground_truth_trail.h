// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "cell_view.h"

namespace assembly_cell::panel {

/// Pose of the peg in the simulation.
struct PegPose {
  double stamp = 0.0;     // ROS time [s]
  Pair offset{}, tilt{};  // as in AlignmentReport [m] [rad]
};

/// Poses of the last 1000 s, for the reference time of an alignment.
class GroundTruthTrail {
 public:
  void add(const PegPose& peg) {
    // the simulation was restarted
    if (!trail_.empty() && peg.stamp < trail_.back().stamp) trail_.clear();
    if (trail_.size() == kMaxLength) trail_.pop_front();
    trail_.push_back(peg);
  }
  /// The first one at or after a time; none if the trail starts later.
  std::optional<PegPose> at(double stamp) const {
    if (trail_.empty() || trail_.front().stamp > stamp + kRounding) return std::nullopt;
    for (const PegPose& peg : trail_) {
      if (peg.stamp >= stamp - kRounding) return peg;
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kMaxLength = 50000;  // blocks, 1000 s
  static constexpr double kRounding = 1e-4;         // well below a block [s]
  std::deque<PegPose> trail_;
};

}  // namespace assembly_cell::panel
