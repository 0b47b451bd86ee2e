// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

// Tilt and hole from directions of contact (thesis 9.8, 9.9), exact
// in the clearance; small tilts add as complex numbers. Plane of the hole as the complex plane,
// origin below the peg's bottom centre, directions anticlockwise from x. [m], [rad]
//
// q = θ_y − i θ_x = |tilt| e^{i low}: low is the direction of the lowest point of the peg's edge. A
// rotation s about the horizontal direction e(a) adds dq = −i s e^{ia}.

/// q of a tilt by its rotation vector (x, y), and back.
inline std::complex<double> tiltAsComplex(const Eigen::Vector2d& tilt) {
  return {tilt.y(), -tilt.x()};
}
inline Eigen::Vector2d tiltFromComplex(std::complex<double> q) { return {-q.imag(), q.real()}; }

/// A contact on the plane (so at the lowest edge point) after the wobble dq. alpha may be off by π.
struct WobbleReading {
  std::complex<double> dq;
  double alpha = 0.0;
};

/// Tilt before the wobble from two directions, exact (in place of 9.20–9.23). Nothing for a wobble
/// along the tilt: sin(a1 − a0) below 1e-9.
std::optional<std::complex<double>> tiltFromWobble(std::complex<double> dq, double a0, double a1);

/// The same from many, by linear least squares.
std::optional<std::complex<double>> tiltFromReadings(const std::vector<WobbleReading>& readings);

/// Point of the edge of a peg tilted by q that lies in direction a, projected onto the plane.
std::complex<double> edgePoint(double radius, std::complex<double> q, double a);

/// Hole from both edge contacts, equal radii (thesis 9.13, 9.14): off by up to
/// √(hole radius² − radius²).
std::complex<double> equalRadiusCentre(double radius, double a1, double a2);

/// Centre of the circle through two points, on the side of `away`. Nothing when they are farther
/// apart than its diameter.
std::optional<std::complex<double>> centreThrough(double hole_radius, std::complex<double> p1,
                                                  std::complex<double> p2,
                                                  std::complex<double> away);

/// Hole from both edge contacts, with clearance and tilt.
std::optional<std::complex<double>> holeFromEdges(double radius, double hole_radius,
                                                  std::complex<double> q, double a1, double a2);

/// Hole from the direction alpha of a double contact (mod π: the segment) and the direction a_c of
/// the one contact that a wobble leaves, with clearance and the tilt q then (9.27, 9.28).
std::optional<std::complex<double>> holeFromDouble(double radius, double hole_radius,
                                                   std::complex<double> q, double alpha,
                                                   double a_c);

/// A contact on the plane after the rotation `turn` about e(alpha) of a double contact.
struct TurnReading {
  double turn = 0.0;
  double alpha = 0.0;  ///< may be off by π
};

/// Tilt along e(alpha) at the double contact from contacts on the plane, least squares (in place of
/// 9.29, 9.30); negative: the hole lies at alpha + π. Nothing where no contact left the line.
std::optional<double> tiltFromDouble(double alpha, const std::vector<TurnReading>& readings);

}  // namespace assembly_cell
