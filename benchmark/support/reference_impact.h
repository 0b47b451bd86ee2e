// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Impact of one point with Coulomb friction and Stronge's energetic coefficient of restitution, to
// any precision: the flow of the slip along the normal impulse in polar coordinates, where it is
// smooth through the end of slip. Independent of the package, which follows it by steps of impulse.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <limits>

namespace assembly_cell::reference {

/// What an impact leaves, in the axes of W and v.
template <typename Real>
struct ImpactResult {
  Eigen::Matrix<Real, 3, 1> impulse;
  Real compression_work = 0, restitution_work = 0;  ///< of the normal force [J]
  bool slip_stopped = false;                        ///< the slip came to its end on the way
};

/// W: velocity of the point by a unit impulse at it, v: its velocity (n · v < 0), mu: of slip,
/// mu_hold: of rest. The normal force gives back e² of the work it took while n · v < 0.
template <typename Real>
ImpactResult<Real> strongeImpact(const Eigen::Matrix<Real, 3, 3>& W,
                                 const Eigen::Matrix<Real, 3, 1>& v,
                                 const Eigen::Matrix<Real, 3, 1>& n, Real mu, Real mu_hold,
                                 Real e) {
  using Vec3 = Eigen::Matrix<Real, 3, 1>;
  const Vec3 t1 = n.unitOrthogonal(), t2 = n.cross(t1);
  const auto along = [&](Real phi) { return Vec3(std::cos(phi) * t1 + std::sin(phi) * t2); };
  const auto across = [&](Real phi) { return Vec3(std::cos(phi) * t2 - std::sin(phi) * t1); };
  // impulse a unit of normal impulse, and the change of the velocity by it, of slip along phi
  const auto ray = [&](Real phi) { return Vec3(n - mu * along(phi)); };
  const auto stretch = [&](Real phi) { return along(phi).dot(W * ray(phi)); };
  const auto swerve = [&](Real phi) { return across(phi).dot(W * ray(phi)); };
  const auto normal = [&](Real phi) { return n.dot(W * ray(phi)); };

  ImpactResult<Real> out;
  out.impulse.setZero();
  Real v_n = n.dot(v), phase_work = 0;
  bool restitution = false, done = false;
  Real owed = 0;
  // a straight piece: constant ray d with normal gain g, at most `most` of normal impulse. Closes
  // compression and restitution in closed form on its way.
  const auto straight = [&](const Vec3& d, Real most) {
    const Real g = n.dot(W * d);
    while (!done && most > 0) {
      Real p = restitution ? (-v_n + std::sqrt(v_n * v_n + 2 * g * owed)) / g : -v_n / g;
      const bool ends = p <= most;
      p = std::min(p, most);
      const Real work = p * (v_n + g * p / 2);
      out.impulse += p * d;
      v_n += g * p;
      most -= p;
      phase_work += work;
      if (restitution) owed -= work;
      if (!ends) return;
      if (restitution) {
        out.restitution_work = phase_work;
        done = true;
      } else {
        out.compression_work = phase_work;
        owed = -e * e * phase_work;
        phase_work = 0;
        restitution = true;
        v_n = 0;
        if (owed <= 0) done = true;
      }
    }
  };
  const Real endless = std::numeric_limits<Real>::infinity();

  // what follows the end of slip: rest where friction holds, else the one direction of new slip
  const auto afterSlip = [&] {
    Eigen::Matrix<Real, 2, 2> Wt;
    Wt << t1.dot(W * t1), t1.dot(W * t2), t2.dot(W * t1), t2.dot(W * t2);
    const Eigen::Matrix<Real, 2, 1> hold =
        -Wt.inverse() * Eigen::Matrix<Real, 2, 1>(t1.dot(W * n), t2.dot(W * n));
    if (hold.norm() <= mu_hold) {
      straight(n + hold(0) * t1 + hold(1) * t2, endless);
      return;
    }
    const Real pi = std::acos(Real(-1));
    constexpr int grid = 720;
    for (int i = 0; i < grid; ++i) {
      Real low = 2 * pi * i / grid, high = 2 * pi * (i + 1) / grid;
      if ((swerve(low) > 0) == (swerve(high) > 0)) continue;
      const bool rises = swerve(high) > 0;
      for (int k = 0; k < 80; ++k) {
        const Real middle = (low + high) / 2;
        ((swerve(middle) > 0) == rises ? high : low) = middle;
      }
      if (stretch(low) > 0) {
        straight(ray(low), endless);
        return;
      }
    }
  };

  const Vec3 slip = v - v_n * n;
  const Real speed = slip.norm();
  if (speed == 0) {
    afterSlip();
    return out;
  }
  const Real phi0 = std::atan2(slip.dot(t2), slip.dot(t1));
  if (mu == 0) {
    straight(n, endless);
    return out;
  }
  // (ln s, phi, P1, P2, P3, v_n, work) over tau, dp = s dtau
  using State = std::array<Real, 7>;
  const auto flow = [&](const State& y, State& dy, Real) {
    const Real s = std::exp(y[0]);
    const Vec3 d = ray(y[1]);
    dy = {stretch(y[1]), swerve(y[1]), s * d(0), s * d(1), s * d(2), s * normal(y[1]), s * y[5]};
  };
  boost::numeric::odeint::runge_kutta_fehlberg78<State, Real, State, Real> stepper;
  State y = {std::log(speed), phi0, 0, 0, 0, v_n, 0};
  const Real rounding = std::numeric_limits<Real>::epsilon();
  const Real scale = std::abs(v_n) + speed, fastest = W.trace() * (1 + mu);
  const Real floor = std::log(scale) + 2 * std::log(rounding);
  Real h = Real(0.01) / fastest;
  while (y[0] > floor) {
    State end, error;
    stepper.do_step(flow, y, Real(0), end, h, error);
    Real worst = 0;
    const Real size[7] = {
        1, 1, scale / fastest, scale / fastest, scale / fastest, scale, scale * scale / fastest};
    for (std::size_t i = 0; i < 7; ++i) worst = std::max(worst, std::abs(error[i]) / size[i]);
    if (worst > 100 * rounding) {
      h *= Real(0.7);
      continue;
    }
    // the phase ends inside: exactly there by bisection of the step
    const auto over = [&](const State& at) { return restitution ? at[6] - owed : at[5]; };
    if (over(end) >= 0) {
      Real low = 0, high = h;
      for (int k = 0; k < 70; ++k) {
        const Real middle = (low + high) / 2;
        stepper.do_step(flow, y, Real(0), end, middle, error);
        (over(end) >= 0 ? high : low) = middle;
      }
      stepper.do_step(flow, y, Real(0), y, high, error);
      if (restitution) {
        out.restitution_work = y[6];
        out.impulse << y[2], y[3], y[4];
        return out;
      }
      out.compression_work = y[6];
      owed = -e * e * y[6];
      y[6] = 0;
      restitution = true;
      if (!(owed > 0)) {
        out.impulse << y[2], y[3], y[4];
        return out;
      }
      continue;
    }
    y = end;
    if (worst < rounding) h *= Real(1.3);
  }
  out.slip_stopped = true;
  out.impulse << y[2], y[3], y[4];
  v_n = y[5];
  phase_work = y[6];
  if (restitution) owed -= y[6];
  afterSlip();
  return out;
}

}  // namespace assembly_cell::reference
