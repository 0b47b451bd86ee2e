// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/insertion/compliance.h"

#include <cmath>

#include "assembly_cell/math/validity.h"

namespace assembly_cell {

double captureRange(const PegInHole& fit, const Chamfers& chamfers) {
  check(fit);
  requireNotNegative({{"hole_chamfer", chamfers.hole_width}, {"peg_chamfer", chamfers.peg_width}});
  if (!(chamfers.peg_width < fit.peg_radius)) {
    refuse("peg_chamfer", chamfers.peg_width, "give one narrower than the peg's radius");
  }
  // the peg's tip has the radius r - width, the mouth R + width
  return finiteResult(
      "capture", (fit.hole_radius - fit.peg_radius) + chamfers.hole_width + chamfers.peg_width);
}

std::optional<double> chamferForceRatio(double slope, double friction) {
  requireNotNegative("friction", friction);
  if (!(slope > 0.0 && slope < M_PI / 2)) {
    refuse("slope", slope, "give one above 0 and below a right angle");
  }
  const double along = std::sin(slope) - friction * std::cos(slope);
  if (!(along > 0.0)) return std::nullopt;
  return finiteResult("force_ratio", (std::cos(slope) + friction * std::sin(slope)) / along);
}

TipLoad mountLoad(const CompliantMount& mount, double x, double turn) {
  requireNotNegative({{"K_x", mount.lateral}, {"K_theta", mount.angular}});
  requireFinite({{"L_g", mount.centre}, {"x", x}, {"turn", turn}});
  // the compliance centre is L_g above the base: a rotation about it moves the base by +L_g turn
  TipLoad load;
  load.F_x = finiteResult("F_x", -mount.lateral * (x - mount.centre * turn));
  load.M = finiteResult("M", -mount.angular * turn - mount.centre * load.F_x);
  return load;
}

}  // namespace assembly_cell
