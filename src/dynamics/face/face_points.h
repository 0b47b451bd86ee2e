// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The three points of a face that lies: which they are. Any three off one line ask for the same
// motion of a flat face, so they may be chosen anew: around the centre of pressure while it lies
// inside the face; one of them where the peg is about to tip.
#pragma once

#include <array>

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

constexpr double kFaceTurn = 2.0 * M_PI / 3.0;  ///< between points all round [rad]

/// The face's points of the slots of `mask`.
void locateFace(const System& s, const Face& face, const EdgeCircle& edge, ContactSlotMask mask,
                ContactSet& set);

/// Slots without a point, apart.
void openPoints(ContactSlotMask points, Context& c, Evaluation& e);
/// Contact points of these slots, found anew while they are open; closed.
void closePoints(const System& s, ContactSlotMask points, Context& c, Evaluation& e);
/// All points at these places, closed.
void setPoints(const System& s, const std::array<double, 3>& t, Context& c, Evaluation& e);

/// Chooses the points of a face anew so that they carry the load that `decided` modes put on them.
/// False where that changes nothing.
bool moveFacePoints(const System& s, double limit, Context& c, Evaluation& e);

/// Where the peg is about to tip about one point of its edge: that point less the one whose gap
/// would shrink fastest [rad]; 0 where none would.
double tippingError(const System& s, double limit, const Context& c, const Evaluation& e);
void tipAbout(const System& s, double t, Context& c, Evaluation& e);
/// The slot of the point about which it does.
std::size_t tippingSlot(const Context& c);

}  // namespace assembly_cell
