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
  double tilt = 0.0;    ///< angle between the peg's and the hole's axis [rad], above 0
  double depth = 0.0;   ///< l: along the peg's side, from its lowest point to the mouth
  double lowest = 0.0;  ///< depth of the peg's lowest point below the face: l cos(tilt)
  double wall_contact =
      0.0;  ///< depth of the contact on the wall below the face: l cos(tilt) - d sin(tilt)
};

/// Two-point contact of a peg with this tilt [rad] at the depth where it first touches both sides:
/// l sin + d cos = D. Throws InputError for a tilt outside 0 < tilt <= acos(d/D): beyond, the other
/// end of the base would be above the hole.
TwoPointContact twoPointContact(const PegInHole& fit, double tilt);

/// Tilt [rad] of two-point contact at a depth l [m] along the side; empty above sqrt(D^2 - d^2),
/// where the base is not in the hole.
std::optional<double> twoPointTilt(const PegInHole& fit, double depth);

/// Maximum depth friction · d [m] at which the peg can wedge: two opposite contact forces inside
/// both friction cones without any load. The line between the contacts is at angles a and a + tilt
/// to the normals, and tan(a + tilt) = l/d exactly.
double wedgingDepth(const PegInHole& fit, double friction);

/// Minimum tilt [rad] whose first two-point contact is at most at wedgingDepth(); empty if the base
/// can't be in the hole at that depth, so that no peg of this fit wedges.
std::optional<double> wedgingTilt(const PegInHole& fit, double friction);

}  // namespace assembly_cell
