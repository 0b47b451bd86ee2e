// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Of what pieces the block of the second world is made: plates around a ring of narrow boxes, whose
// inner faces are the bore's facets.
#pragma once

#include <algorithm>

#include "assembly_cell/dynamics/soft_contact.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

struct BoreLayout {
  static constexpr int kPlates = 16;
  int facets = 0;
  double rim = 0.0;      ///< radius of the bore [m]
  double chamfer = 0.0;  ///< width [m]
  double deep = 0.0;     ///< how far down the chamfer goes [m]
  double mouth = 0.0;    ///< radius at the face: rim and chamfer [m]
  double plate = 0.0;    ///< distance of the plates' inner faces from the axis [m]
  double reach = 0.0;    ///< of the ring of narrow boxes: no gap up to the plates [m]
  double depth = 0.0;    ///< [m]
  double lean = 0.0;     ///< of the bore's axis, per unit of depth

  /// How far an upright box goes down whose inner face is at `distance` from the axis: a bore that
  /// leans would run into it, and has its own walls there. [m]
  double uprightDepth(double distance) const {
    return lean > 0.0 ? std::min(depth, 0.5 * (distance - rim) / lean) : depth;
  }
};
BoreLayout boreLayout(const Scenario& scenario, const SoftContact& contact);

}  // namespace assembly_cell
