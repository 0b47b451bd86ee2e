// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/search/search_state.h"

namespace assembly_cell {

/// Recovery after a failed attempt: out of whatever the peg is in, and aside to another place.
class Retreat {
 public:
  explicit Retreat(SearchState& state) : s_(state) {}

  /// Frees the peg and lifts it by `travel` [m], zero checked; where the first pull fails,
  /// upright and then from four sides. Throws AlignError as retreatUp().
  void backOut(double travel);
  /// The hole is on the low side of a peg tilted by R: later offsets lead away from it.
  void avoidLowSide(const Eigen::Matrix3d& R);
  /// Lateral offset from a failed attempt, in S, another direction each time [m]. tilt: of the peg
  /// at the next contact [rad].
  Eigen::Vector3d nextOffset(double tilt);
  /// Lateral offset at which neither edge contact is steep: beyond √(R² − r²) the rim crosses the
  /// edge ahead of the peg's middle, and the crossing's normal is within 20 degrees of upright at
  /// this tilt. [m]
  double trapWidth(double tilt) const;

 private:
  SearchState& s_;
  Eigen::Vector3d aside_ = Eigen::Vector3d::UnitX();  // away from the hole, as far as is known
  int offsets_ = 0;                                   // since aside_ was set
};

}  // namespace assembly_cell
