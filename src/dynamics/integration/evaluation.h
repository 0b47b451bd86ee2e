// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The right-hand side v' = f(t, q, v) with the modes of the contacts frozen.
#pragma once

#include "contact/contact_algebra.h"
#include "context.h"

namespace assembly_cell {

/// Extent of an evaluation: forces alone (within a step), or also the event functions (its end).
enum class Level : std::uint8_t { kForces, kEvents };

/// v' at time t and a state: free motion, contact points, contact forces. `c`: context at the start
/// of the step; e: workspace and result.
Vector9 evaluate(const System& s, const Context& c, double t, const State& state, Level level,
                 Evaluation& e);

/// Free motion alone: sets e.k and e.free.
void evaluateFree(const System& s, const Commands& commands, double t, const State& state,
                  Evaluation& e);
/// evaluateFree() and locateAll() at the context's time and state.
void evaluatePresent(const System& s, const Context& c, Evaluation& e);

/// Contact points of the slots in `mask` at e.k; `set`: e.closed_set or e.open_set.
void locate(const System& s, const Context& c, ContactSlotMask mask, Evaluation& e,
            ContactSet& set);
/// Contact points of all admitted slots, independent of the bounds of clearance.
void locateAll(const System& s, const Context& c, Evaluation& e);

/// Upper bounds at the peg's edge: speed [m/s], acceleration without contacts [m/s²].
double edgeSpeed(const System& s, const Kinematics& k);
double freeAcceleration(const System& s, const Evaluation& e);

Body bodyOf(const System& s, const Kinematics& k);

/// Change of the generalised accelerations (velocities) by a force (impulse) and its moment about
/// the centre of mass.
Vector9 accelerationBy(const System& s, const Kinematics& k, const ForceMoment& by);

}  // namespace assembly_cell
