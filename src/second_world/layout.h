// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Shapes of the hole block in MuJoCo: plates around a ring of narrow boxes, whose inner faces are
// the bore's facets.
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
  double deep = 0.0;     ///< depth of the chamfer [m]
  double mouth = 0.0;    ///< radius at the face: rim and chamfer [m]
  double plate = 0.0;    ///< distance of the plates' inner faces from the axis [m]
  double reach = 0.0;  ///< outer radius of the ring of narrow boxes, in contact with the plates [m]
  double depth = 0.0;  ///< [m]
  double lean = 0.0;   ///< inclination of the bore's axis, lateral per unit of depth

  /// Depth of an upright box with its inner face at `distance` from the axis, so that it does not
  /// reach into an inclined bore, which has walls of its own below [m].
  double uprightDepth(double distance) const {
    return lean > 0.0 ? std::min(depth, 0.5 * (distance - rim) / lean) : depth;
  }
};
BoreLayout boreLayout(const Scenario& scenario, const SoftContact& contact);

}  // namespace assembly_cell
