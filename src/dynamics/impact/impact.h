// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Discontinuous changes of velocity: collisions, Painlevé impacts, and the projection of closed
// rigid contacts. After each, e has the contact points at the new velocities.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// Applies an impulse [N s] with its moment [N m s] to the peg.
void applyImpulse(const System& s, const ForceMoment& impulse, Context& c, Evaluation& e);

/// Collision; at least one closed point approaches. Points with restitution bounce sequentially,
/// the fastest first; remaining or slow approaches end in one plastic impact of all closed points,
/// or in sequential ones if friction leaves that without a solution.
void impact(const System& s, Context& c, Evaluation& e);

/// Impact without restitution: no point approaches afterwards, normal impulses are not negative,
/// Coulomb's law with the sliding coefficient holds for the slip after the impact. The impulses
/// [N s] are stored as forces in e.contacts.
void plasticImpact(const System& s, ContactSlotMask points, Context& c, Evaluation& e);

/// Painlevé (frictional) impact, without a collision: the force of slipping points grows without
/// bound within finite time, or no force is consistent with their slip. Brings the set of points to
/// rest that loses most energy, of all sets that impulses within the friction cones can stop
/// without another point approaching; all points if there is no such set, or if `everything` (the
/// set did not suffice).
void painleveImpact(const System& s, bool everything, Context& c, Evaluation& e);

/// Projection onto the constraints of closed rigid contacts: sets gaps, gap rates and the slip of
/// sticking contacts to zero by the minimum correction in the metric of the kinetic energy, with
/// frictionless rows. True if the state has changed by more than the tolerance: e is outdated.
bool project(const System& s, Context& c, const Evaluation& e);

/// Kinetic, elastic and potential energy at the context's state [J]. e: of a state near it.
double energyOf(const System& s, const Context& c, const Evaluation& e);
/// Scales all velocities so that the energy is at most `limit` [J].
void limitEnergy(const System& s, double limit, Context& c, const Evaluation& e);

}  // namespace assembly_cell
