// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

namespace assembly_cell {

/// 4.41: maximum half contact angle at which a single contact sticks, and the overlap there.
struct WalkingLimit {
  double alpha = 0.0;    ///< half contact angle (delta) [rad]; a right angle: always sticks
  double overlap = 0.0;  ///< 2r(1 − cos alpha)
};
/// Corrected: 8.35 % for mu = 0.2 and r = h is of the diameter, not of the radius.
WalkingLimit walkingLimit(double mu, double r, double h);

/// Peg on a chord at distance d = r cos_alpha, X toward the hole, contacts A and B at Y = ±s; equal
/// rotational stiffness K about all axes. Starts in static equilibrium at t = 0.
struct WalkCase {
  double m = 0.0, g = 0.0, r = 0.0, h = 0.0, K = 0.0, F = 0.0, w = 0.0, cos_alpha = 0.0;
  int cycles = 0;  ///< periods of the force
};

/// Interval on a single contact.
struct WalkPhase {
  double t_lift = 0.0, duration = 0.0;
  double dZ = 0.0;            ///< yaw gained [rad]
  double outward_step = 0.0;  ///< dx of the peg's axis along X: negative is out of the hole
  bool on_a = true;           ///< pivot A (Y > 0)
};

/// Rotation about the main axes.
struct WalkMotion {
  double theta_X = 0.0, theta_Y = 0.0, theta_Z = 0.0;
};

/// From start until the next segment: pivot 0 both contacts, +1 A, −1 B.
struct WalkSegment {
  double start = 0.0;
  int pivot = 0;
  double theta_Y = 0.0, theta_Y_dot = 0.0, theta_Z = 0.0;
};

struct Walk {
  std::vector<WalkPhase> phases;
  std::vector<WalkSegment> segments;
  double dx = 0.0;  ///< sum of the steps
  bool tension =
      false;  ///< both contacts would have lifted at once at some time: outside the model
};

/// 4.7: alternating double and single contact, no sliding. Normal forces of the double contact with
/// inertia (4.31 is their static limit, for either contact). Corrected: contact closes again when
/// theta_X, not theta_x, is zero; then angular momentum about the chord is conserved (the thesis
/// keeps theta_Y'); signs of 4.36; Ω² in 4.37.
Walk walk(const WalkCase& c);

/// Motion at a time within the walk, t >= 0.
WalkMotion walkMotion(const WalkCase& c, const Walk& walk, double t);

}  // namespace assembly_cell
