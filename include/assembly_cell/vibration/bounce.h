// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

namespace assembly_cell {

/// Flight after an impulse J upwards on the peg's edge, from rest, in the plane of X (toward the
/// hole) and Z. kx: transverse stiffness at l above the top; Krot: the support's own.
struct FreeFlight {
  double m = 0.0;
  double I = 0.0;  ///< about the centre of mass
  double kx = 0.0, Krot = 0.0, h = 0.0, l = 0.0, r = 0.0, J = 0.0, g = 0.0;
};

struct FreeFlightState {
  double w_hi = 0.0, w_lo = 0.0;  ///< natural frequencies [rad/s]
  double X = 0.0, Z = 0.0, theta = 0.0;
};

/// 4.45–4.48. Corrected: m X'' in 4.45, l + h for 1 + h, square roots of the modes' squares,
/// K_Y = Krot + kx (l + h)². Holds for Krot = 0 (w_lo = 0). t >= 0.
FreeFlightState freeFlight(const FreeFlight& f, double t);

struct TipCase {
  double m = 0.0, g = 0.0, r = 0.0, h = 0.0, l = 0.0, kx = 0.0;
  double K_chord = 0.0;  ///< 4.17
  double F = 0.0, w = 0.0;
  double alpha = 0.0;  ///< half contact angle (delta) [rad]
  double restitution = 0.0;
};

/// Quantities of events that don't occur (tipping, impact, flight) are empty, and so are all later
/// ones.
struct TipResult {
  std::optional<double> t_tip, t_impact, omega_impact;  ///< omega: theta' just before impact
  std::optional<double> impulse, t_flight, X_end;
};

/// 4.42–4.48: a peg flat on the plane against two edge contacts tips under F sin wt, falls back,
/// and flies until the chord or the plane is touched again. J = e I |theta'|/(r + d), a model: a
/// rigid plastic stop would need a pulling chord. The edge leaves the chord only for d < I_cm/(m
/// r). Throws InputError for 2Fh >= m g r, with which it also tips about the far edge.
TipResult tipBounce(const TipCase& c);

}  // namespace assembly_cell
