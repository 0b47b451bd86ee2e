// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Forces of sticking contacts, which are not unique.
#pragma once

#include "context.h"

namespace assembly_cell {

/// If all contacts stick and their minimum-norm forces are outside the friction cones: searches
/// equivalent forces inside the cones and stores them in the slots (Slot::rest_force). False if
/// there are none or the minimum-norm forces are unique.
bool findAdmissibleRestForces(const System& s, double limit, Context& c, Evaluation& e);

}  // namespace assembly_cell
