// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Choice of the three contact points of a face, see face.h.
#pragma once

#include <array>

#include "context.h"
#include "integration/evaluation.h"

namespace assembly_cell {

constexpr double kFaceTurn = 2.0 * M_PI / 3.0;  ///< between equally spaced points [rad]

/// Contact points of the face in the slots of `mask`.
void locateFace(const System& s, const Face& face, const EdgeCircle& edge, ContactSlotMask mask,
                ContactSet& set);

/// Opens the slots and invalidates their points.
void openPoints(ContactSlotMask points, Context& c, Evaluation& e);
/// Locates the contact points of these slots while they are open, and closes them.
void closePoints(const System& s, ContactSlotMask points, Context& c, Evaluation& e);
/// Moves the three points to these parameters t and closes them.
void setPoints(const System& s, const std::array<double, 3>& t, Context& c, Evaluation& e);

/// Moves the points of a face to carry its load with forces that push. limit: hysteresis of
/// accelerations [m/s²]. False if no point has moved.
bool moveFacePoints(const System& s, double limit, Context& c, Evaluation& e);

/// For a peg that tips about one point of its edge: parameter of that point less that of the point
/// whose gap decreases fastest [rad]; 0 if none decreases.
double tippingError(const System& s, double limit, const Context& c, const Evaluation& e);
void tipAbout(const System& s, double t, Context& c, Evaluation& e);
/// Slot of the tipping point.
std::size_t tippingSlot(const Context& c);

}  // namespace assembly_cell
