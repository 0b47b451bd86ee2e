// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

namespace assembly_cell {

// Two-point contact of a round peg in a round hole, in the plane of the peg's tilt: the edge of its
// base touches the wall, its side the mouth on the other side. Exact for any tilt
// (docs/theory/insertion.md has the derivations); the usual forms for small tilt are in Whitney,
// "Quasi-static assembly of compliantly supported rigid parts", J. Dyn. Sys. Meas. Control 104
// (1982) 65-77.

/// Radii [m], 0 < peg < hole.
struct PegInHole {
  double peg_radius = 0.0;
  double hole_radius = 0.0;
};
/// Throws InputError naming the radius that is out of range.
void check(const PegInHole& fit);

/// All lengths in [m], d = 2 peg_radius, D = 2 hole_radius.
struct TwoPointContact {
  double tilt = 0.0;    ///< of the peg's axis against the hole's [rad], above 0
  double depth = 0.0;   ///< l: along the peg's side, from its lowest point to the mouth
  double lowest = 0.0;  ///< of the peg below the face: l cos(tilt)
  double wall_contact =
      0.0;  ///< of the contact on the wall below the face: l cos(tilt) - d sin(tilt)
};

/// The depth at which a peg of this tilt [rad] first touches both sides: l sin + d cos = D. Throws
/// InputError for a tilt outside 0 < tilt <= acos(d/D): beyond, the other end of the base would
/// stand out of the hole.
TwoPointContact twoPointContact(const PegInHole& fit, double tilt);

/// The tilt [rad] that two-point contact allows at a depth l [m] along the side; empty above
/// sqrt(D^2 - d^2), where the base isn't in the hole yet.
std::optional<double> twoPointTilt(const PegInHole& fit, double depth);

/// A peg can be wedged, held by two contact forces that oppose each other inside both cones of
/// friction with no load at all, where l <= friction * d: the line between the contacts makes with
/// one normal and the other the angles a and a + tilt, and tan(a + tilt) = l/d exactly. [m]
double wedgingDepth(const PegInHole& fit, double friction);

/// The least tilt [rad] whose first two-point contact is that deep; empty where the base can't be
/// in the hole at that depth, so that no peg of this fit is wedged.
std::optional<double> wedgingTilt(const PegInHole& fit, double friction);

}  // namespace assembly_cell
