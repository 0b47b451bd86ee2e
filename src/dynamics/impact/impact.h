// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What changes velocities at once: impacts, jams, and the projection of closed rigid contacts. All
// leave e with the contact points of the new velocities.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// Impulse on the peg: velocities change, the contact points are found anew.
void applyImpulse(const System& s, const ForceMoment& impulse, Context& c, Evaluation& e);

/// At least one closed point approaches. Points that bounce do so one after the other, the fastest
/// first; what still approaches then, or too slowly to bounce, is stopped by one plastic impact of
/// all closed points, or one after the other where friction leaves that without a solution.
void impact(const System& s, Context& c, Evaluation& e);

/// Impact without restitution: no point approaches afterwards, impulses only push, Coulomb's law
/// with the sliding coefficient on the slip after the impact. The impulses are left as e's forces.
void plasticImpact(const System& s, ContactSlotMask points, Context& c, Evaluation& e);

/// Impact without collision: friction wedges slipping points the faster the harder they press
/// (Painlevé's paradox, two points against each other) and force grows without bound within finite
/// time, or no force agrees with their slip at all. Points come to rest at once: of all sets that
/// impulses within the cones of friction bring to rest without another point approaching, the one
/// that loses most energy; all points where there is none, or where it wasn't enough
/// (`everything`).
void jam(const System& s, bool everything, Context& c, Evaluation& e);

/// Closed contacts stay closed: gaps, gap rates and the slip of sticking contacts are put to zero
/// by the smallest correction in the metric of the kinetic energy. Frictionless rows throughout.
/// True where it changed the state by more than a step may be off by: e isn't of it any more.
bool project(const System& s, Context& c, const Evaluation& e);

/// Kinetic, elastic and potential energy at the context's state [J]. e: of a state near it.
double energyOf(const System& s, const Context& c, const Evaluation& e);
/// Takes from all speeds alike what the present energy is above `limit`.
void limitEnergy(const System& s, double limit, Context& c, const Evaluation& e);

}  // namespace assembly_cell
