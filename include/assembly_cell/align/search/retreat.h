// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/search/search_state.h"

namespace assembly_cell {

/// Recovery after a failed attempt: frees the peg and chooses another place.
class Retreat {
 public:
  explicit Retreat(SearchState& state) : s_(state) {}

  /// Frees the peg, lifts it by `travel` [m] and checks the zero. Where pulling it up tilted fails,
  /// it is made upright first, and then moved to four sides. Throws AlignError as retreatUp().
  void backOut(double travel);
  /// Makes later offsets lead away from the low side of a peg with axes R, where the hole is.
  void avoidLowSide(const Eigen::Matrix3d& R);
  /// Lateral offset of the next attempt from the failed one, in S, in another direction each time
  /// [m]. tilt: the peg's at the next contact [rad].
  Eigen::Vector3d nextOffset(double tilt);
  /// Least lateral offset at which neither contact of the edge is steep. Beyond √(R² − r²) the rim
  /// crosses the edge ahead of the peg's middle, and there the normal is within 20 degrees of
  /// upright at this tilt. [m]
  double trapWidth(double tilt) const;

 private:
  SearchState& s_;
  Eigen::Vector3d aside_ = Eigen::Vector3d::UnitX();  // away from the hole, if it is known
  int offsets_ = 0;                                   // offsets since aside_ was set
};

}  // namespace assembly_cell
