// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

// Steady vibration under a force F (cos wt, sin wt) at the peg's top, sticking contacts. Undamped:
// an exciter at a resonance is refused.

struct ContactRotation {
  double theta_x = 0.0, theta_y = 0.0, theta_z = 0.0;  ///< about the principal axes [rad]
};

/// Peg, stiffness about the contact and force; the contact lies in direction alpha.
struct SingleContactCase {
  double m = 0.0, r = 0.0, h = 0.0, K = 0.0, F = 0.0, w = 0.0, alpha = 0.0;
};

/// 4.7–4.9 (right as printed): single contact, equal rotational stiffness K.
ContactRotation singleContact(const SingleContactCase& s, double t);

/// 4.16: rotation about the chord of a double contact, K and I of 4.17 and 4.18, at time t.
double doubleContact(double F, double h, double K, double I, double w, double t);

}  // namespace assembly_cell
