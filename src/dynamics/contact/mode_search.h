// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Search for consistent modes of the closed contacts at one instant, and for the direction of slip
// that begins. A search, as each mode depends on the forces of all contacts.
#pragma once

#include "context.h"

namespace assembly_cell {

/// Changes modes one by one until none is violated or a combination recurs: contacts that pull
/// become idle, those outside their cone slip, idle ones that approach carry. first: first call of
/// a decision, which sets `limit`, the hysteresis of accelerations [m/s²].
void iterateModes(const System& s, bool first, double& limit, Context& c, Evaluation& e);

/// Largest violation of the modes: pulling, outside a cone, idle and approaching [N].
double worstViolation(const System& s, const Context& c, const Evaluation& e);

/// If the violation exceeds the limit: sets the combination of modes with the smallest violation,
/// by enumeration. Only for few points and without a face contact.
void enumerateModes(const System& s, double limit, Context& c, Evaluation& e);

/// Solves for the direction of slip that begins: opposite to its friction.
void solveSlipDirections(const System& s, double limit, Context& c, Evaluation& e);

}  // namespace assembly_cell
