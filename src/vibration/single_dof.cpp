// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/single_dof.h"

#include <complex>

#include "assembly_cell/math/validity.h"
#include "numeric.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using vibration::sinc;

// (e^{iwu} − e^{su})/(iw − s) = u e^{su} (e^z − 1)/z with z = (iw − s) u; also for z → 0
Complex drivenTerm(double w, Complex s, double u) {
  const Complex z = (Complex(0.0, w) - s) * u;
  if (std::norm(z) > 1.0) return (std::polar(1.0, w * u) - std::exp(s * u)) / (z / u);
  if (z == 0.0) return u * std::exp(s * u);
  const double half = std::sin(z.imag() / 2);
  const Complex difference(std::expm1(z.real()) * std::cos(z.imag()) - 2 * half * half,
                           std::exp(z.real()) * std::sin(z.imag()));
  return u * std::exp(s * u) * difference / z;
}

// Undamped solution; differences of frequencies are formed before the sine, so that w near W loses
// no digits.
SingleDofState undamped(const SingleDof& s, double t) {
  const double u = t - s.t1, W = std::sqrt(s.K / s.I);
  const double sw = std::sin(s.w * (t + s.t1) / 2), cw = std::cos(s.w * (t + s.t1) / 2);
  const double sh = std::sin(W * u / 2), ch = std::cos(W * u / 2);
  const double near = sinc((s.w - W) * u / 2), far = sinc((s.w + W) * u / 2);
  const double sin1 = sw * ch + cw * sh, cos1 = cw * ch - sw * sh;
  const double sin2 = sw * ch - cw * sh, cos2 = cw * ch + sw * sh;
  const double force = u / (2 * s.I);
  const double sin_free = 2 * sh * ch, one_minus_cos = 2 * sh * sh, cos_free = 1 - one_minus_cos;
  SingleDofState x;
  x.theta = force / W * (near * (s.A * sin1 - s.B * cos1) - far * (s.A * sin2 - s.B * cos2)) +
            s.C / s.K * one_minus_cos + s.th1 * cos_free + s.thd1 / W * sin_free;
  x.theta_dot = force * (near * (s.A * cos1 + s.B * sin1) + far * (s.A * cos2 + s.B * sin2)) +
                s.C / (s.I * W) * sin_free - s.th1 * W * sin_free + s.thd1 * cos_free;
  return x;
}

SingleDofState damped(const SingleDof& s, double t) {
  const double u = t - s.t1, W2 = s.K / s.I, W = std::sqrt(W2), gamma = s.c / s.I / 2;
  const Complex force(s.A, -s.B);
  Complex part, part_rate;  // forced part, from rest
  double cosine, sine;      // e^{-gamma u} cos Wd u, e^{-gamma u} sin(Wd u)/Wd
  if (gamma < W / 2) {
    const double Wd = std::sqrt((W - gamma) * (W + gamma)), decay = std::exp(-gamma * u);
    const Complex s1(-gamma, Wd), s2(-gamma, -Wd);
    const Complex e1 = drivenTerm(s.w, s1, u), e2 = drivenTerm(s.w, s2, u);
    const Complex scale = force * std::polar(1.0, s.w * s.t1) / (s.I * Complex(0.0, 2 * Wd));
    part = scale * (e1 - e2);
    part_rate = scale * (s1 * e1 - s2 * e2);
    cosine = decay * std::cos(Wd * u);
    sine = decay * std::sin(Wd * u) / Wd;
  } else {
    // far from a sharp resonance, and for critical and higher damping: steady state − free decay of
    // its initial values
    const double kappa2 = (gamma - W) * (gamma + W);
    if (kappa2 > 0.0) {
      const double kappa = std::sqrt(kappa2), slow = std::exp(-W2 / (gamma + kappa) * u);
      cosine = slow * (1 + std::exp(-2 * kappa * u)) / 2;
      sine = slow * -std::expm1(-2 * kappa * u) / (2 * kappa);
    } else {
      const double Wd = std::sqrt(-kappa2), decay = std::exp(-gamma * u);
      cosine = decay * std::cos(Wd * u);
      sine = decay * u * sinc(Wd * u);
    }
    const Complex G = force / Complex(s.K - s.I * s.w * s.w, s.c * s.w);
    const Complex start = G * std::polar(1.0, s.w * s.t1), start_rate = Complex(0, s.w) * start;
    const Complex now = G * std::polar(1.0, s.w * t);
    part = now - start * cosine - (start_rate + gamma * start) * sine;
    part_rate =
        Complex(0, s.w) * now - start_rate * cosine + (gamma * start_rate + W2 * start) * sine;
  }
  const double lag = cosine + gamma * sine;
  SingleDofState x;
  x.theta = part.real() + s.C / s.K * (1 - lag) + s.th1 * lag + s.thd1 * sine;
  x.theta_dot =
      part_rate.real() + s.C / s.I * sine + s.thd1 * cosine - (gamma * s.thd1 + W2 * s.th1) * sine;
  return x;
}

}  // namespace

SingleDofState singleDof(const SingleDof& s, double t) {
  requirePositive({{"I", s.I}, {"K", s.K}});
  requireNotNegative("c", s.c);
  requireFinite({{"A", s.A},
                 {"B", s.B},
                 {"C", s.C},
                 {"w", s.w},
                 {"t1", s.t1},
                 {"th1", s.th1},
                 {"thd1", s.thd1}});
  if (!(t >= s.t1) || !std::isfinite(t)) refuse("t", t, "give a time, at least t1");
  const SingleDofState x = s.c == 0.0 ? undamped(s, t) : damped(s, t);
  finiteResult("theta", x.theta);
  finiteResult("theta_dot", x.theta_dot);
  return x;
}

}  // namespace assembly_cell
