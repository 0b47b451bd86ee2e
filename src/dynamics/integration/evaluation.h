// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The right-hand side v' = f(t, q, v) with the modes of the contacts frozen.
#pragma once

#include "contact/contact_algebra.h"
#include "context.h"

namespace assembly_cell {

/// How much an evaluation must find: forces alone (inside a step), or what events need (its end).
enum class Level : std::uint8_t { kForces, kEvents };

/// v' at time t and a state: free motion, contact points, contact forces. `c`: where the step
/// started; e: workspace and result.
Vector9 evaluate(const System& s, const Context& c, double t, const State& state, Level level,
                 Evaluation& e);

/// Free motion alone: e.k and e.free.
void evaluateFree(const System& s, const Commands& commands, double t, const State& state,
                  Evaluation& e);
/// The same at the context's time and state, with the contact points of all admitted slots.
void evaluatePresent(const System& s, const Context& c, Evaluation& e);

/// Contact points of the slots in `mask` at e.k, of one of the two sets of e.
void locate(const System& s, const Context& c, ContactSlotMask mask, Evaluation& e,
            ContactSet& set);
/// Contact points of all admitted slots, whatever the bounds say.
void locateAll(const System& s, const Context& c, Evaluation& e);

/// Bounds at the peg's edge: of its speed [m/s], of its acceleration without contacts [m/s²].
double edgeSpeed(const System& s, const Kinematics& k);
double freeAcceleration(const System& s, const Evaluation& e);

Body bodyOf(const System& s, const Kinematics& k);

/// Change of the generalised velocity rates (velocities) by contact forces (impulses) with this
/// moment about the centre of mass.
Vector9 accelerationBy(const System& s, const Kinematics& k, const ForceMoment& by);

}  // namespace assembly_cell
