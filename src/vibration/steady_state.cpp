// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/steady_state.h"

#include <limits>

#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/validity.h"

namespace assembly_cell {
namespace {

// K − I w²; refuses what is rounding alone
double dynamicStiffness(double K, double I, double w) {
  const double value = K - I * w * w;
  if (!(std::abs(value) > 8 * std::numeric_limits<double>::epsilon() * K)) {
    refuse("w", w, "a resonance has no undamped steady state, change w or use the model sdof");
  }
  return value;
}

}  // namespace

ContactRotation singleContact(double m, double r, double h, double K, double F, double w,
                              double alpha, double t) {
  requirePositive("K", K);
  requireNotNegative("F", F);
  requireNotNegative("w", w);
  requireFinite("alpha", alpha);
  requireFinite("t", t);
  const ContactInertia i = contactInertia(m, r, h);
  const double tau = w * t - alpha;
  requireFinite("w t", tau);
  const double sin_tau = std::sin(tau), sb = std::sin(i.beta), cb = std::cos(i.beta);
  ContactRotation x;
  x.theta_x = -2 * F * h * std::cos(tau) / dynamicStiffness(K, i.Ix, w);
  x.theta_y = -F * (r * sb + 2 * h * cb) * sin_tau / dynamicStiffness(K, i.Iy, w);
  x.theta_z = -F * (r * cb - 2 * h * sb) * sin_tau / dynamicStiffness(K, i.Iz, w);
  finiteResult("theta_x", x.theta_x);
  finiteResult("theta_y", x.theta_y);
  finiteResult("theta_z", x.theta_z);
  return x;
}

PlaneRotation planeRotation(const ContactRotation& rotation, double beta) {
  requireFinite("theta_y", rotation.theta_y);
  requireFinite("theta_z", rotation.theta_z);
  requireFinite("beta", beta);
  return {finiteResult("theta_p", std::hypot(rotation.theta_y, rotation.theta_z)),
          beta + std::atan2(rotation.theta_z, rotation.theta_y)};
}

double doubleContact(double F, double h, double K, double I, double w, double t) {
  requireNotNegative("F", F);
  requirePositive("h", h);
  requirePositive("K", K);
  requirePositive("I", I);
  requireNotNegative("w", w);
  requireFinite("t", t);
  requireFinite("w t", w * t);
  return finiteResult("theta", 2 * F * h * std::cos(w * t) / dynamicStiffness(K, I, w));
}

SingleContactForces singleContactForces(double m, double r, double h, double l, double k, double g,
                                        double F, double w, double alpha, double t,
                                        const ContactRotation& rotation) {
  requireNotNegative("l", l);
  requireNotNegative("k", k);
  requireNotNegative("g", g);
  requireNotNegative("F", F);
  requireFinite("w", w);
  requireFinite("alpha", alpha);
  requireFinite("t", t);
  requireFinite("theta_x", rotation.theta_x);
  requireFinite("theta_y", rotation.theta_y);
  requireFinite("theta_z", rotation.theta_z);
  const double beta = contactInertia(m, r, h).beta, sb = std::sin(beta), cb = std::cos(beta);
  const double about_y = rotation.theta_y * cb - rotation.theta_z * sb;
  const double about_z = rotation.theta_y * sb + rotation.theta_z * cb;
  const double tau = w * t - alpha, height = 2 * h + l;
  requireFinite("w t", tau);
  SingleContactForces f;
  f.X = -rotation.theta_x * height;         // L sin th2 = 2h + l
  f.Y = -(about_y * height + about_z * r);  // theta_p L sin th1: arm of G about P
  f.Z = -rotation.theta_x * r;              // L cos th2 = r
  f.radial = F * std::cos(tau) - k * f.X;
  f.tangential = F * std::sin(tau) - k * f.Y;
  f.normal = m * g + k * f.Z;
  finiteResult("radial", f.radial);
  finiteResult("tangential", f.tangential);
  finiteResult("normal", f.normal);
  return f;
}

}  // namespace assembly_cell
