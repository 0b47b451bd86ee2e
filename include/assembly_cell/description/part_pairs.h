// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/description/cell_description.h"

namespace assembly_cell {

/// Workspace of the carrier: bottom edge centre of the peg at rest relative to the hole's rim
/// centre, and rotation of the carrier about its origin.
struct CarrierTravel {
  double lateral = 0.010;  ///< maximum |x|, |y| [m]
  double lowest = -0.030;  ///< minimum z [m]
  double highest = 0.020;  ///< maximum z [m]
  double rotation = 0.05;  ///< maximum of tilt plus yaw [rad]
};

using PartPair = std::pair<std::string, std::string>;

/// Pairs (moving link, fixed link) that can touch within the workspace; other pairs need no contact
/// search. Conservative: each moving shape is replaced by the box that it sweeps. Meant for
/// start-up. Throws InputError for a travel that is empty or not finite.
std::vector<PartPair> canMeet(const CellDescription& description, const CarrierTravel& travel);

/// True when two shapes with poses in the same frame touch or overlap.
bool shapesMeet(const PartShape& a, const PartShape& b);

}  // namespace assembly_cell
