// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contact forces of one evaluation, for given modes of the slots.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// v' with the forces of the active contacts, which are stored in e.contacts. By mode:
///
///   slip   direction of the force known: g'' = −k g' − beta g, one unknown
///   stick  acceleration of the peg's point prescribed: three unknowns
///   idle   no force; ContactKinematics::demand is set
///
/// (rigid law: k = beta = 0.) With regularised friction all directions are known; the normal forces
/// are those of springs, or the solution of the rows of the carrying points.
Vector9 contactForces(const System& s, const SlotArray& slots, Level level, Evaluation& e);

/// contactForces() at the same state with other modes or slip directions
/// (e.contacts[i].tangential).
Vector9 recomputeForces(const System& s, const SlotArray& slots, Level level, Evaluation& e);

/// contactForces() with regularised friction, after selecting the active contacts that carry
/// (slip; the others: idle) and the branch of friction of each.
Vector9 chooseCarriers(const System& s, SlotArray& slots, Evaluation& e);

/// Forces with regularised friction, of springs or of the linear complementarity problem of all
/// points. `carriers`: slots that carry, or kUndecided. Returns the carrying slots.
constexpr ContactSlotMask kUndecided = ~0u;
ContactSlotMask regularisedForces(const System& s, const SlotArray& slots, ContactSlotMask carriers,
                                  Evaluation& e);

/// Acceleration of a contact's point with contact forces and rolling [m/s²].
Eigen::Vector3d accelerationOf(const Body& body, const Evaluation& e, std::size_t i);

/// Slip speed of a contact's point; for the points of a face the maximum over the face [m/s].
double slipSpeed(const Evaluation& e, std::size_t i);

/// A contact slips whose slip has exceeded the threshold (Slot::armed).
bool slips(const SlotArray& slots);

/// Tangential force less the static friction limit [N].
double coneExcess(const System& s, const Evaluation& e, std::size_t i);
/// coneExcess() of all these points is at most `by` [N].
bool insideCones(const System& s, const Evaluation& e, ContactSlotMask points, double by);

/// Chooses the internal forces of sticking points (pairs of opposite forces along their connection,
/// without influence on the motion) pair by pair, each up to `limit` times the total load, so that
/// the points are as far inside their friction cones as possible.
void shareInternalForces(const System& s, ContactSlotMask points, double limit, Evaluation& e);

}  // namespace assembly_cell
