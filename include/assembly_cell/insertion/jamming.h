// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>

#include "assembly_cell/insertion/two_point.h"

namespace assembly_cell {

/// Load on the peg at the centre of its base, in the plane of tilt: x to the right, z out of the
/// hole.
struct TipLoad {
  double F_x = 0.0;  ///< force to the right [N]
  double F_z = 0.0;  ///< force into the hole [N]
  double M = 0.0;    ///< moment, anticlockwise with z up and x to the right [N m]
};

/// Jamming diagram of Whitney (1982), for small tilts: a peg in contact continues to slide in if
/// |F_x/F_z| < 1/friction and |M/(r F_z) + (1 + lambda) friction F_x/F_z| < lambda. Any contact of
/// either sense: sides of the parallelogram are two-point contacts, corners one-point contacts.
struct JammingDiagram {
  double friction = 0.0;
  double radius = 0.0;  ///< radius of the peg [m]
  double lambda = 0.0;  ///< depth / (2 radius friction)
};
/// depth: along the peg's side [m]. Throws InputError for a value that is not positive.
JammingDiagram jammingDiagram(double peg_radius, double depth, double friction);

/// A load in the diagram's coordinates.
struct JammingPoint {
  double lateral = 0.0;  ///< F_x/F_z
  double moment = 0.0;   ///< M/(radius F_z)
  double margin = 0.0;   ///< distance to the nearest side, positive inside: slides; else jams
};
/// Throws InputError unless F_z > 0.
JammingPoint jammingPoint(const JammingDiagram& diagram, const TipLoad& load);

/// Corners of the parallelogram in order, {lateral, moment}.
std::array<std::array<double, 2>, 4> corners(const JammingDiagram& diagram);

/// Jamming margin of a peg at rest in two-point contact with the tilt `tilt` to the right (top to
/// +x, base on the left wall, side at the right mouth), for rigid bodies and exact for any tilt.
/// Positive: both contacts can balance the load and the peg is jammed; negative: it moves. The
/// value is the sine of the angle of the load to the nearest face of the cone of balanced loads in
/// the space (F_x, F_z, M/r). Throws InputError if the peg can wedge (depth <= friction d:
/// undetermined) and for a zero load.
double restMargin(const PegInHole& fit, double tilt, double friction, const TipLoad& load);

}  // namespace assembly_cell
