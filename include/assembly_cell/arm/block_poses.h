// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <deque>
#include <optional>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Poses of the carrier at the ends of blocks, interpolated between the arm's states of the last
/// second. A block's pose is available once a state at or after its end has been received. [s]
class BlockPoses {
 public:
  struct BlockPose {
    double end = 0.0;
    Pose X;  ///< carrier in carrier_base
  };
  void addBlock(double end);
  /// coordinates: see coordinatesOf().
  void addState(double time, const Vector6& coordinates);
  /// The next block's pose, oldest first; none: no block is left, or its state is missing.
  std::optional<BlockPose> next();
  /// A block's pose hasn't been returned yet.
  bool pending() const { return !ends_.empty(); }

 private:
  struct State {
    double time;
    Vector6 coordinates;
  };
  std::deque<State> states_;
  std::deque<double> ends_;
};

}  // namespace assembly_cell
