// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Steps through slow slip. Friction points against the velocity, so it turns as fast as the
// velocity does, at a rate of μN W/|v_t|, W what the point answers to a force across its slip. A
// point that begins to slip, or passes near rest, has a rate of 1e6 1/s where the motion has 1e3,
// and an explicit method is stable over two or three of that rate's times only. Here the direction
// of slip is implicit, one angle for each sliding point, and all else explicit: no step is shorter
// than the motion asks for, and slip may begin at rest.
#pragma once

#include "integration/integrator.h"

namespace assembly_cell {

/// Fastest rate at which friction turns the slip of a sliding point [1/s]: 0 where none slides, or
/// more do than a step here can take. e: of the present.
double slipTurning(const System& s, const Context& c, const Evaluation& e);

/// Rate at which the slip of a sliding point falls, of the one that comes to rest, or passes it,
/// first [1/s]: 0 where none falls. e: of the present.
double slipFalling(const System& s, const Context& c, const Evaluation& e);

/// A step of length step.h from the context's state by ARK4(3)6L[2]SA (Kennedy & Carpenter, Appl.
/// Numer. Math. 44, 2003), the direction of slip by its implicit part: order 4 with an estimate of
/// order 3, L-stable and stiffly accurate in it. An infinite error says that no direction was
/// found. e: of its end.
void attemptSlowSlip(const System& s, const Context& c, Trial& step, Evaluation& e);

/// After such a step: friction of slip that has just begun points against the slip.
void followSlip(const System& s, Context& c, const Evaluation& e);

}  // namespace assembly_cell
