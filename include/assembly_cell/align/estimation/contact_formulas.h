// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

// Tilt and hole from contacts (thesis 9.9), exact in the clearance; small tilts add as complex
// numbers. Plane of the hole as the complex plane,
// origin below the peg's bottom centre, directions anticlockwise from x. [m], [rad]
//
// q = θ_y − i θ_x = |tilt| e^{i low}: low is the direction of the lowest point of the peg's edge. A
// rotation s about the horizontal direction e(a) adds dq = −i s e^{ia}.

/// q of a tilt by its rotation vector (x, y), and back.
inline std::complex<double> tiltAsComplex(const Eigen::Vector2d& tilt) {
  return {tilt.y(), -tilt.x()};
}
inline Eigen::Vector2d tiltFromComplex(std::complex<double> q) { return {-q.imag(), q.real()}; }

/// Centre of the circle through two points, on the side of `away`: the hole from both edge contacts
/// (thesis 9.13, 9.14, which leave out the clearance). Nothing when they are farther
/// apart than its diameter.
std::optional<std::complex<double>> centreThrough(double hole_radius, std::complex<double> p1,
                                                  std::complex<double> p2,
                                                  std::complex<double> away);

/// A contact on the plane after the rotation `turn` about e(alpha) of a double contact.
struct TurnReading {
  double turn = 0.0;
  double alpha = 0.0;  ///< may be off by π
};

/// Tilt along e(alpha) at the double contact from contacts on the plane, least squares (in place of
/// 9.29, 9.30); negative: the hole lies at alpha + π. Nothing where no contact left the line.
std::optional<double> tiltFromDouble(double alpha, const std::vector<TurnReading>& readings);

}  // namespace assembly_cell
