// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

// Solid cylinder of mass m, radius r, height 2h; contacts on its bottom edge. Any coherent units.

/// Inertia about the edge contact point. Local axes: x tangent (clockwise), y radial outward, z up.
struct ContactInertia {
  double Ix = 0.0, Iy = 0.0, Iz = 0.0;    ///< principal, about x and the axes turned by beta
  double beta = 0.0;                      ///< from the horizontal to the y principal axis [rad]
  double Iy_local = 0.0, Iz_local = 0.0;  ///< about the radial and the vertical axis
  double Iyz_local = 0.0;                 ///< tensor element, +m r h
};

/// After 4.37. Corrected: beta = atan2(24rh, 16h² − 15r²)/2 (printed 12rh, and without a quadrant);
/// short pegs have beta → 90°, not 0.
ContactInertia contactInertia(double m, double r, double h);

/// Moment of inertia about the horizontal transverse axis through the centre of mass.
double centroidInertia(double m, double r, double h);

/// Moment of inertia about the chord through both contacts, 4.18; d = r cos(delta): distance of the
/// peg's axis from the chord.
double chordInertia(double m, double r, double h, double d);

/// Rotational stiffness about the chord, 4.17 corrected: kx (2h + l)² + KY + kz d² (printed (2h +
/// 1)² and kz r²(1 − cos)²).
double chordStiffness(double kx, double kz, double KY, double h, double l, double d);

}  // namespace assembly_cell
