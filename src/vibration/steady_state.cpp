// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/steady_state.h"

#include <limits>

#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"

namespace assembly_cell {
namespace {

// K − I w²; throws InputError where it is rounding.
double dynamicStiffness(double K, double I, double w) {
  const double value = K - I * w * w;
  if (!(std::abs(value) > 8 * std::numeric_limits<double>::epsilon() * K)) {
    refuse("w", w, "a resonance has no undamped steady state, change w or use the model sdof");
  }
  return value;
}

}  // namespace

ContactRotation singleContact(const SingleContactCase& s, double t) {
  requirePositive("K", s.K);
  requireNotNegative({{"F", s.F}, {"w", s.w}});
  requireFinite({{"alpha", s.alpha}, {"t", t}});
  const ContactInertia i = contactInertia(s.m, s.r, s.h);
  const double tau = s.w * t - s.alpha;
  requireFinite("w t", tau);
  const double sin_tau = std::sin(tau), sb = std::sin(i.beta), cb = std::cos(i.beta);
  ContactRotation x;
  x.theta_x = -2 * s.F * s.h * std::cos(tau) / dynamicStiffness(s.K, i.Ix, s.w);
  x.theta_y = -s.F * (s.r * sb + 2 * s.h * cb) * sin_tau / dynamicStiffness(s.K, i.Iy, s.w);
  x.theta_z = -s.F * (s.r * cb - 2 * s.h * sb) * sin_tau / dynamicStiffness(s.K, i.Iz, s.w);
  finiteResult("theta_x", x.theta_x);
  finiteResult("theta_y", x.theta_y);
  finiteResult("theta_z", x.theta_z);
  return x;
}

double doubleContact(double F, double h, double K, double I, double w, double t) {
  requireNotNegative({{"F", F}, {"w", w}});
  requirePositive({{"h", h}, {"K", K}, {"I", I}});
  requireFinite({{"t", t}, {"w t", w * t}});
  return finiteResult("theta", 2 * F * h * std::cos(w * t) / dynamicStiffness(K, I, w));
}

}  // namespace assembly_cell
