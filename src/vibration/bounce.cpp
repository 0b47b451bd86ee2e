// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/bounce.h"

#include <algorithm>

#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/single_dof.h"
#include "numeric.h"

namespace assembly_cell {
namespace {

using vibration::sinc;

constexpr int kStepsPerTurn = 400;  // samples per period of the fastest motion, to find the impact
constexpr int kTurns = 20;          // periods of the force within which the peg falls back

// (sinc a − sinc b)/(a² − b²); by its series where the difference cancels.
double sincQuotient(double a2, double b2) {
  if (a2 > 1.0) {
    return (sinc(std::sqrt(a2)) - sinc(std::sqrt(b2))) / (a2 - b2);
  }
  double sum = 0.0, coefficient = 1.0, power = 1.0, homogeneous = 1.0;
  for (int k = 1; k <= 9; ++k) {
    coefficient /= -(2.0 * k) * (2.0 * k + 1.0);
    sum += coefficient * homogeneous;
    power *= b2;
    homogeneous = homogeneous * a2 + power;  // sum of a2^i b2^j with i + j = k
  }
  return sum;
}

// First zero in (0, end] of f, which is positive after 0: by samples and bisection.
template <typename Function>
std::optional<double> firstReturn(double step, double end, const Function& f) {
  double before = 0.0;
  for (double t = step; t <= end; t += step) {
    if (f(t) <= 0.0) {
      double low = before, high = t;
      if (low == 0.0) {  // negative within the first step: finds a positive value
        low = t / 2;
        for (int k = 0; k < 40 && f(low) <= 0.0; ++k) low /= 2;
        if (f(low) <= 0.0) return std::nullopt;
      }
      return vibration::lastOf(low, high, [&](double x) { return f(x) > 0.0; });
    }
    before = t;
  }
  return std::nullopt;
}

}  // namespace

FreeFlightState freeFlight(const FreeFlight& f, double t) {
  requirePositive({{"m", f.m}, {"I", f.I}, {"h", f.h}, {"r", f.r}});
  requireNotNegative(
      {{"kx", f.kx}, {"Krot", f.Krot}, {"l", f.l}, {"J", f.J}, {"g", f.g}, {"t", t}});
  const double arm = f.l + f.h, a = f.kx / f.m, b = (f.Krot + f.kx * arm * arm) / f.I;
  // roots of w⁴ − (a + b) w² + a Krot/I; the smaller by the product, so it may be 0
  const double coupling = a * arm * std::sqrt(f.m / f.I);
  const double hi2 = (a + b) / 2 + std::hypot((a - b) / 2, coupling);
  const double lo2 = hi2 > 0.0 ? a * (f.Krot / f.I) / hi2 : 0.0;
  const double quotient = sincQuotient(hi2 * t * t, lo2 * t * t), spin = f.J * f.r / f.I;
  FreeFlightState x;
  x.w_hi = std::sqrt(hi2);
  x.w_lo = std::sqrt(lo2);
  x.X = finiteResult("X", a * arm * spin * t * t * t * quotient);
  x.theta = finiteResult("theta", spin * t * (sinc(x.w_lo * t) + (hi2 - a) * t * t * quotient));
  x.Z = finiteResult("Z", f.J / f.m * t - f.g * t * t / 2);
  return x;
}

TipResult tipBounce(const TipCase& c) {
  requirePositive(
      {{"m", c.m}, {"g", c.g}, {"r", c.r}, {"h", c.h}, {"K_chord", c.K_chord}, {"w", c.w}});
  requireNotNegative({{"l", c.l}, {"kx", c.kx}, {"F", c.F}});
  if (!(c.alpha >= 0.0 && c.alpha <= M_PI / 2)) {
    refuse("alpha", c.alpha, "give the half contact angle, from 0 to a right angle");
  }
  if (!(c.restitution >= 0.0 && c.restitution <= 1.0)) {
    refuse("restitution", c.restitution, "give a number from 0 to 1");
  }
  const double arm = 2 * c.h + c.l, spring = c.kx * arm * arm;
  if (spring > c.K_chord * (1 + 1e-9)) {
    refuse("K_chord", c.K_chord, "give at least kx (2h + l)^2, a part of it (4.17)");
  }
  if (2 * c.F * c.h >= c.m * c.g * c.r) {
    refuse("F", c.F, "give less than m g r/(2h), else the peg tips about the far edge as well");
  }
  const double d = std::max(0.0, c.r * std::cos(c.alpha)), I_chord = chordInertia(c.m, c.r, c.h, d);
  const double moment = 2 * c.F * c.h, weight = c.m * c.g * d;
  TipResult x;
  if (!(moment > weight)) return x;
  x.t_tip = std::asin(weight / moment) / c.w;
  const SingleDof tip{I_chord, c.K_chord, 0, 0, moment, -weight, c.w, *x.t_tip, 0, 0};
  const double fastest = std::max(c.w, std::sqrt(c.K_chord / I_chord));
  if (!(fastest <= 1e4 * c.w)) refuse("w", c.w, "give a frequency nearer to the peg's resonance");
  const std::optional<double> duration =
      firstReturn(2 * M_PI / fastest / kStepsPerTurn, 2 * M_PI / c.w * kTurns,
                  [&](double u) { return singleDof(tip, *x.t_tip + u).theta; });
  if (!duration) return x;
  x.t_impact = *x.t_tip + *duration;
  x.omega_impact = singleDof(tip, *x.t_impact).theta_dot;
  x.impulse = c.restitution * I_chord * std::abs(*x.omega_impact) / (c.r + d);
  const FreeFlight flight{c.m,  centroidInertia(c.m, c.r, c.h),
                          c.kx, std::max(0.0, c.K_chord - spring),
                          c.h,  c.l,
                          c.r,  *x.impulse,
                          c.g};
  // minimum of the heights of the peg over the chord and of the far edge over the plane
  const auto gap = [&](double t) {
    const FreeFlightState s = freeFlight(flight, t);
    return std::min(s.Z - d * s.theta, s.Z + c.r * s.theta);
  };
  const double longest = 2 * *x.impulse / (c.m * c.g);  // for a body without rotation
  if (longest > 0.0 && d < centroidInertia(c.m, c.r, c.h) / (c.m * c.r)) {
    x.t_flight = firstReturn(longest / kStepsPerTurn, longest * 1.01, gap);
  }
  if (x.t_flight) x.X_end = freeFlight(flight, *x.t_flight).X;
  return x;
}

}  // namespace assembly_cell
