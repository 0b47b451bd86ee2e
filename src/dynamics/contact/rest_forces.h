// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Forces of contacts that all rest: those that hold the peg are many.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Where the least forces of contacts that all rest are beyond their cones: looks for others that
/// hold the peg as well and are inside, and keeps them in the slots (Slot::rest_force). False where
/// there are none, or the least ones are the only ones.
bool holdAtRest(const System& s, double limit, Context& c, Evaluation& e);

}  // namespace assembly_cell
