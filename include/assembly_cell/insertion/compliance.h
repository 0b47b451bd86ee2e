// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/insertion/jamming.h"
#include "assembly_cell/insertion/two_point.h"

namespace assembly_cell {

/// Chamfers, cone frustums: their widths are radial [m], 0 for none.
struct Chamfers {
  double hole_width = 0.0;
  double peg_width = 0.0;
  double slope = 0.0;  ///< of the cone that touches, against the face [rad], below a right angle
};

/// The greatest lateral error [m] from which an upright peg is led in: both widths and the
/// clearance. Throws InputError for a negative width or one of the peg's radius and more.
double captureRange(const PegInHole& fit, const Chamfers& chamfers);

/// Force into the hole for each newton of lateral resistance, on the chamfer:
/// (cos + friction sin)/(sin - friction cos). Empty where tan(slope) <= friction: it sticks.
std::optional<double> chamferForceRatio(double slope, double friction);

/// A compliant holder by its compliance centre: the point where a lateral force turns nothing.
struct Holder {
  double lateral = 0.0;  ///< K_x [N/m]
  double angular = 0.0;  ///< K_theta [N m/rad]
  double centre = 0.0;  ///< L_g: of the compliance centre above the peg's base [m]; negative: below
};

/// How the holder loads the peg at the centre of its base when this is shifted by x [m] to the
/// right and the peg turned anticlockwise by `turn` [rad] against where the holder rests. F_z is 0.
TipLoad holderLoad(const Holder& holder, double x, double turn);

}  // namespace assembly_cell
