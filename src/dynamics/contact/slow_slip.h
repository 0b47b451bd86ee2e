// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Integration of slow slip, where the direction of friction is stiff: it follows the direction of
// the slip velocity v_t at a rate of μN W/|v_t|, W the inverse mass of the point across its slip. A
// point that begins to slip, or passes near rest, has a rate of 1e6 1/s where the motion has 1e3,
// and the steps of an explicit method are limited to two or three times its reciprocal. Here the
// direction of slip is integrated implicitly (one angle for each slipping point) and all else
// explicitly: the step follows the accuracy of the motion alone, and slip may begin at rest.
#pragma once

#include "integration/integrator.h"

namespace assembly_cell {

/// Maximum over the slipping points of the rate μN W/|v_t| [1/s]; 0 if none slips, or more than
/// attemptSlowSlip() supports. e: of the present.
double slipTurning(const System& s, const Context& c, const Evaluation& e);

/// Maximum over the slipping points of the rate −(d|v_t|/dt)/|v_t| [1/s], of the one that comes to
/// rest or passes near it first; 0 if no slip falls. e: of the present.
double slipFalling(const System& s, const Context& c, const Evaluation& e);

/// A step of length step.h from the context's state by ARK4(3)6L[2]SA (Kennedy & Carpenter, Appl.
/// Numer. Math. 44, 2003), the direction of slip by its implicit part: order 4 with an estimate of
/// order 3, L-stable and stiffly accurate in it. The error is infinite if the implicit equations
/// were not solved. e: of the step's end.
void attemptSlowSlip(const System& s, const Context& c, Trial& step, Evaluation& e);

/// After such a step: sets the friction of slip that has just begun opposite to the slip.
void followSlip(const System& s, Context& c, const Evaluation& e);

}  // namespace assembly_cell
