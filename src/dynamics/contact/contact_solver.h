// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contact forces of one evaluation, for given modes of the slots.
#pragma once

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

/// v' with the forces of the active contacts, left in e.contacts. What depends on their modes:
///
///   sliding (slip)    direction of the force known: g'' = −k g' − beta g, one unknown
///   sticking (stick)  the peg's point comes to rest: three unknowns
///   idle              no force; `demand` says what its gap would do
///
/// (rigid law: k = beta = 0.) With regularised friction all directions are known; the normal forces
/// are those of springs, or solve the rows of the carrying points.
Vector9 contactForces(const System& s, const SlotArray& slots, Level level, Evaluation& e);

/// The same at the same state, with other modes or directions of slip (e.contacts[i].tangential).
Vector9 forcesAgain(const System& s, const SlotArray& slots, Level level, Evaluation& e);

/// The same with regularised friction, after choosing which active contacts carry (slip) and which
/// don't (idle), and the branch of friction of each.
Vector9 chooseCarriers(const System& s, SlotArray& slots, Evaluation& e);

/// Forces with regularised friction of springs, or of the linear complementarity of all points.
/// `carriers`: slots that carry, or kUndecided; returns those that do.
constexpr ContactSlotMask kUndecided = ~0u;
ContactSlotMask regularisedForces(const System& s, const SlotArray& slots, ContactSlotMask carriers,
                                  Evaluation& e);

/// Of a contact's point, contact forces included, as it rolls [m/s²].
Eigen::Vector3d accelerationOf(const Body& body, const Evaluation& e, std::size_t i);

/// Of a contact's point; of those of a face, which slip or rest together, the fastest's [m/s].
double slipSpeed(const Evaluation& e, std::size_t i);

/// Some contact slides, and not only since now.
bool slips(const SlotArray& slots);

/// Tangential force beyond what static friction holds [N].
double coneExcess(const System& s, const Evaluation& e, std::size_t i);
/// None of these points needs more friction than there is, by more than this [N].
bool insideCones(const System& s, const Evaluation& e, ContactSlotMask points, double by);

/// Sticking points share the forces along their connections, which move nothing, pair by pair, each
/// up to `limit` times the load of all, so that they stay as far inside their cones as possible.
void shareInternalForces(const System& s, ContactSlotMask points, double limit, Evaluation& e);

}  // namespace assembly_cell
