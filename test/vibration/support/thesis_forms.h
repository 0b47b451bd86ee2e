// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Forms of thesis chapters 4 and 5 that the tool doesn't need: the tests compare with them.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/steady_state.h"

namespace assembly_cell {

/// 4.10: the part of the wobble in the plane of y and z.
struct PlaneRotation {
  double theta_p = 0.0;  ///< size [rad]
  double axis = 0.0;     ///< angle of its axis P over the radial direction [rad]
};
inline PlaneRotation planeRotation(const ContactRotation& rotation, double beta) {
  requireFinite("theta_y", rotation.theta_y);
  requireFinite("theta_z", rotation.theta_z);
  requireFinite("beta", beta);
  return {finiteResult("theta_p", std::hypot(rotation.theta_y, rotation.theta_z)),
          beta + std::atan2(rotation.theta_z, rotation.theta_y)};
}

/// Support at G, l above the peg's top, with transverse stiffness k in all directions.
struct TransverseSupport {
  double l = 0.0, k = 0.0, g = 0.0;
};

/// Forces on a sticking single contact.
struct SingleContactForces {
  double X = 0.0, Y = 0.0, Z = 0.0;  ///< 4.11–4.13: support point G, radial, tangential (ccw), up
  double radial = 0.0, tangential = 0.0;  ///< 4.14, outward and counter-clockwise
  double normal = 0.0;                    ///< 4.15; not positive: the contact lifts
};

/// 4.11–4.15. Corrected: the l of these equations is the distance L = sqrt(r² + (2h + l)²) from the
/// contact to G.
inline SingleContactForces singleContactForces(const SingleContactCase& s,
                                               const TransverseSupport& support, double t,
                                               const ContactRotation& rotation) {
  requireNotNegative("l", support.l);
  requireNotNegative("k", support.k);
  requireNotNegative("g", support.g);
  requireNotNegative("F", s.F);
  requireFinite("w", s.w);
  requireFinite("alpha", s.alpha);
  requireFinite("t", t);
  requireFinite("theta_x", rotation.theta_x);
  requireFinite("theta_y", rotation.theta_y);
  requireFinite("theta_z", rotation.theta_z);
  const double beta = contactInertia(s.m, s.r, s.h).beta, sb = std::sin(beta), cb = std::cos(beta);
  const double about_y = rotation.theta_y * cb - rotation.theta_z * sb;
  const double about_z = rotation.theta_y * sb + rotation.theta_z * cb;
  const double tau = s.w * t - s.alpha, height = 2 * s.h + support.l;
  requireFinite("w t", tau);
  SingleContactForces f;
  f.X = -rotation.theta_x * height;           // L sin th2 = 2h + l
  f.Y = -(about_y * height + about_z * s.r);  // theta_p L sin th1: arm of G about P
  f.Z = -rotation.theta_x * s.r;              // L cos th2 = r
  f.radial = s.F * std::cos(tau) - support.k * f.X;
  f.tangential = s.F * std::sin(tau) - support.k * f.Y;
  f.normal = s.m * support.g + support.k * f.Z;
  finiteResult("radial", f.radial);
  finiteResult("tangential", f.tangential);
  finiteResult("normal", f.normal);
  return f;
}

/// 4.31: force above which a quasi-static double contact lifts, m g s/(2h) with s = r sin(delta).
inline double liftingForce(double m, double g, double r, double h, double delta) {
  return m * g * r * std::sin(delta) / (2 * h);
}

/// p1 and p2 of one of the two forms of slidingRatio.
struct SlidingPair {
  std::optional<double> p1, p2;
};
inline SlidingPair slidingPair(const SlidingCase& s, bool inertia) {
  const SlidingRatio x = slidingRatio(s);
  return inertia ? SlidingPair{x.p1_inertia, x.p2_inertia} : SlidingPair{x.p1, x.p2};
}

/// One slide of the rig, in its own units.
inline RigSlide rigSlide(const RigCase& c, double x) {
  const double A = 2 * c.M_over_L, w = 2 * M_PI * c.f_hz;
  for (const double value : {A, c.f_hz, c.K, c.g}) requirePositive("rig", value);
  if (!(x > 0.0 && x < A)) refuse("x", x, "give a misalignment between 0 and 2 M_over_L");
  const double a = c.K * c.g / (A * w * w);
  requirePositive("K g / (2 M_over_L w^2)", a);
  const RigSlide s = rigSlide(x / A, a);
  return {finiteResult("time", s.time / w), s.x * A};
}

/// Below this frequency one slide of the rig assembles [1/s]; x0 < 2 M_over_L.
inline double rigOneSlideFrequency(const RigCase& c) {
  if (c.x0 >= 2 * c.M_over_L) refuse("x0", c.x0, "give less than 2 M_over_L, else it never tips");
  const double turn = (std::acos(c.x0 / (2 * c.M_over_L)) + M_PI / 2) / (2 * M_PI);
  return finiteResult("f", turn * std::sqrt(c.K * c.g / (2 * c.x0)));
}

}  // namespace assembly_cell
