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
  double slope = 0.0;  ///< angle of the touching cone to the face [rad], below a right angle
};

/// Capture range: maximum lateral error [m] from which the chamfers guide an upright peg into the
/// hole, the sum of both widths and the clearance. Throws InputError for a negative width or one of
/// the peg's radius and more.
double captureRange(const PegInHole& fit, const Chamfers& chamfers);

/// Force into the hole per newton of lateral resistance, on the chamfer:
/// (cos + friction sin)/(sin - friction cos). Empty for tan(slope) <= friction: it sticks.
std::optional<double> chamferForceRatio(double slope, double friction);

/// Compliant tool mount by its compliance centre, where a lateral force causes no rotation.
struct CompliantMount {
  double lateral = 0.0;  ///< K_x [N/m]
  double angular = 0.0;  ///< K_theta [N m/rad]
  double centre = 0.0;  ///< L_g: of the compliance centre above the peg's base [m]; negative: below
};

/// Load of the mount on the peg at the centre of its base, for a displacement of that centre by x
/// [m] to the right and a rotation of the peg by `turn` [rad] anticlockwise from equilibrium. F_z
/// is 0.
TipLoad mountLoad(const CompliantMount& mount, double x, double turn);

}  // namespace assembly_cell
