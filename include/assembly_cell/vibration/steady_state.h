// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

// Steady vibration under a force F (cos wt, sin wt) at the peg's top, sticking contacts. Undamped:
// an exciter at a resonance is refused.

struct ContactRotation {
  double theta_x = 0.0, theta_y = 0.0, theta_z = 0.0;  ///< about the principal axes [rad]
};

/// 4.7–4.9 (right as printed): single contact in direction alpha, equal rotational stiffness K.
ContactRotation singleContact(double m, double r, double h, double K, double F, double w,
                              double alpha, double t);

/// 4.10: the part of the wobble in the plane of y and z.
struct PlaneRotation {
  double theta_p = 0.0;  ///< size [rad]
  double axis = 0.0;     ///< angle of its axis P over the radial direction [rad]
};
PlaneRotation planeRotation(const ContactRotation& rotation, double beta);

/// 4.16: rotation about the chord of a double contact, K and I of 4.17 and 4.18, at time t.
double doubleContact(double F, double h, double K, double I, double w, double t);

/// Forces on a sticking single contact.
struct SingleContactForces {
  double X = 0.0, Y = 0.0, Z = 0.0;  ///< 4.11–4.13: support point G, radial, tangential (ccw), up
  double radial = 0.0, tangential = 0.0;  ///< 4.14, outward and counter-clockwise
  double normal = 0.0;                    ///< 4.15; not positive: the contact lifts
};

/// 4.11–4.15 with transverse stiffness k in all directions at G, l above the peg's top. Corrected:
/// the l of these equations is the distance L = sqrt(r² + (2h + l)²) from the contact to G.
SingleContactForces singleContactForces(double m, double r, double h, double l, double k, double g,
                                        double F, double w, double alpha, double t,
                                        const ContactRotation& rotation);

}  // namespace assembly_cell
