// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// URDF of the cell with these parts, which loadCellDescription() parses to the same numbers:
/// an aluminium block round the bore, 20 mm of wall, on sensor_a; the peg below sensor_b. For the
/// default cell it is urdf/cell.urdf. A hole without a depth gets the block's height, 60 mm at
/// least.
std::string cellUrdf(const Mechanism& mechanism);

}  // namespace assembly_cell
