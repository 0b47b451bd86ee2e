// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "links/cell_view.h"

namespace assembly_cell::panel {

/// Where the peg truly was, for the moment that an alignment tells of.
struct TruePeg {
  double stamp = 0.0;     // ROS time [s]
  Pair offset{}, tilt{};  // as in AlignmentReport [m] [rad]
};

class TruthTrail {
 public:
  void add(const TruePeg& peg) {
    // the simulation began anew
    if (!trail_.empty() && peg.stamp < trail_.back().stamp) trail_.clear();
    if (trail_.size() == kLongest) trail_.pop_front();
    trail_.push_back(peg);
  }
  /// The first one at or after a time; none where the trail began later than that.
  std::optional<TruePeg> at(double stamp) const {
    if (trail_.empty() || trail_.front().stamp > stamp + kRounding) return std::nullopt;
    for (const TruePeg& peg : trail_) {
      if (peg.stamp >= stamp - kRounding) return peg;
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kLongest = 50000;  // blocks, 1000 s
  static constexpr double kRounding = 1e-4;       // well below a block [s]
  std::deque<TruePeg> trail_;
};

}  // namespace assembly_cell::panel
