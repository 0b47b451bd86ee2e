// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Random scenes for stress runs and their judgement. Shared by test_random_scenes and the benchmark
// tool `stress`.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <utility>

#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell::stress {

/// What a run was and what came of it.
struct Verdict {
  std::string scene;     ///< law, integrator and further settings
  std::string reason;    ///< how it ended
  double reached = 0.0;  ///< time [s]
  double gain = 0.0;     ///< largest energy gain over what the tolerance allows (EnergyBalance)
  double share = 0.0;    ///< and over the energy in play
  double evaluations = 0.0;
  bool finite = true;  ///< state and energy stayed finite while the run said ok
  bool hung = false;   ///< took more than kPatience evaluations
};

// Evaluations of a run of hundredths of a second: most take thousands, a minute of a core is so
// many.
constexpr std::int64_t kPatience = 50'000'000;

/// Energy of a run less the work put into it: by the exciter and the constant push, and by the
/// viscous law where it pushes on a point that leaves the block slower than its rate. Dampers,
/// friction and impacts only take, so that the rest never grows but by the error of a step: at most
/// the tolerance in each coordinate, 30/m as much of angles and 30/s of rates (errorOf in
/// src/dynamics/integration/integrator.cpp).
class EnergyBalance {
 public:
  explicit EnergyBalance(const Simulation& sim) : sim_(sim), s_(sim.scenario()) {
    last_ = at();
    lowest_ = last_.energy;
    // what can move: kinetic and elastic energy, and the weight over a peg's length
    const double weight = s_.mechanism.peg.mass * s_.mechanism.gravity;
    in_play_ = std::abs(lowest_ - weight * sim.state().q(0)) +
               weight * 2 * s_.mechanism.peg.half_height +
               1e-6 * s_.mechanism.peg.mass * s_.mechanism.peg.radius * s_.mechanism.peg.radius;
  }

  /// After each step.
  void step() {
    const Moment now = at();
    const double h = now.time - last_.time;
    const bool smooth = sim_.counts().events == events_;
    // velocities at three points of Gauss from the state at both ends; past an event that may have
    // changed velocities at once, from the start and where the step ended
    for (const auto& [u, weight] :
         {std::pair(0.11270166537925831, 5.0 / 18), std::pair(0.5, 8.0 / 18),
          std::pair(0.88729833462074169, 5.0 / 18)}) {
      work_ += h * weight * power(last_.time + u * h, between(last_, now, u, smooth));
    }
    // a force that ends with the step isn't seen there
    work_ += h * (smooth ? 0.5 * (last_.push + now.push) : std::max(last_.push, now.push));
    // and the trapezium's own error: where the push jumps half of that, where it changes a tenth
    allowed_ += h * (smooth ? 0.1 : 0.5) * std::abs(now.push - last_.push);
    events_ = sim_.counts().events;
    last_ = now;
    allowed_ += s_.solver.tolerance * sensitivity();
    const double left = now.energy - work_;
    // nothing puts work in: no scene of 6000 gained more than 1e-7 of the energy in play
    const bool passive =
        s_.mechanism.exciter.amplitude == 0.0 && s_.contact.law != ContactLaw::kViscous;
    const double allowed = passive ? std::min(allowed_, 1e-6 * in_play_) : allowed_;
    gain_ = std::max(gain_, (left - lowest_) / (allowed + 1e-15 * in_play_));
    share_ = std::max(share_, (left - lowest_) / in_play_);
    // a compliant contact gives back what it stored, a rigid one stores nothing
    if (s_.contact.law != ContactLaw::kSpringDashpot) lowest_ = std::min(lowest_, left);
  }
  double gain() const { return gain_; }
  double share() const { return share_; }

 private:
  struct Moment {
    double time, energy, push;  ///< push: of the viscous law [W]
    State state;
    Vector9 acceleration;
  };

  Moment at() const {
    Moment m{sim_.time(), sim_.energy(), 0.0, sim_.state(), sim_.acceleration()};
    if (s_.contact.law != ContactLaw::kViscous) return m;
    const Kinematics k = kinematics(m.state);
    for (const ContactReport& c : sim_.contacts()) {
      if (!c.valid) continue;
      const Eigen::Vector3d r = toThesisAxes(c.point) - k.x;
      const double rate = toThesisAxes(c.normal).dot(k.v + k.omega.cross(r));
      m.push += std::max(0.0, c.normal.dot(c.force) * rate);
    }
    return m;
  }

  static State between(const Moment& a, const Moment& b, double u, bool smooth) {
    const double h = b.time - a.time;
    const Vector9 v0 = h * a.state.v, a0 = h * h * a.acceleration, d = b.state.q - a.state.q;
    State s;
    if (!smooth) {
      const Vector9 c3 = d - v0 - 0.5 * a0;
      s.q = a.state.q + u * (v0 + u * (0.5 * a0 + u * c3));
      s.v = (v0 + u * (a0 + u * 3.0 * c3)) / h;
      return s;
    }
    const Vector9 v1 = h * b.state.v, a1 = h * h * b.acceleration;
    const Vector9 c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
    const Vector9 c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
    const Vector9 c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
    s.q = a.state.q + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
    s.v = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
    return s;
  }

  /// Of the exciter and the push.
  double power(double t, const State& state) const {
    const Kinematics k = kinematics(state);
    const Eigen::Vector2d f = exciterForce({s_.mechanism.exciter, 0.0}, t);
    const Eigen::Vector3d force =
        k.R0 * (f(0) - s_.push(1)) + k.R1 * (f(1) + s_.push(0)) + k.a * s_.push(2);
    return force.dot(k.v + s_.mechanism.peg.exciter_height * k.omega.cross(k.a));
  }

  /// Energy by an error of one tolerance in every coordinate [J/m].
  double sensitivity() const {
    double sum = 0.0;
    const RestMotion rest = restMotion(restProfile(s_.rest), 0.0);
    for (int i = 0; i < 18; ++i) {
      const bool angle = i % 9 == 3 || i % 9 == 4 || i % 9 == 5 || i % 9 == 8;
      const double error = (angle ? 30.0 : 1.0) * (i < 9 ? 1.0 : 30.0);
      const double step = 1e-6 * error * s_.mechanism.peg.radius;
      State low = sim_.state(), high = low;
      (i < 9 ? low.q : low.v)(i % 9) -= step;
      (i < 9 ? high.q : high.v)(i % 9) += step;
      const double change = mechanicalEnergy(s_, kinematics(high), high, rest) -
                            mechanicalEnergy(s_, kinematics(low), low, rest);
      sum += error * std::abs(change) / (2.0 * step);
    }
    return sum;
  }

  const Simulation& sim_;
  const Scenario& s_;
  Moment last_;
  double lowest_ = 0.0, in_play_ = 0.0, work_ = 0.0, allowed_ = 0.0, gain_ = 0.0, share_ = 0.0;
  std::int64_t events_ = 0;
};

/// Runs for `duration`, watching energy after each step and finiteness at 40 times.
inline Verdict evaluate(const Scenario& s, double duration) {
  Verdict v;
  Simulation sim(s);
  EnergyBalance balance(sim);
  StopReason reason = sim.stopReason();
  for (int i = 1; i <= 40 && reason == StopReason::kOk && !v.hung; ++i) {
    const double until = duration * i / 40;
    while (reason == StopReason::kOk && sim.time() < until && !v.hung) {
      const double time = sim.time();
      reason = sim.advance(until, 1);
      if (reason == StopReason::kOk && sim.time() > time) balance.step();
      v.hung = sim.counts().evaluations > kPatience;
    }
    if (reason == StopReason::kNonFinite) break;
    v.finite = v.finite && sim.state().q.allFinite() && sim.state().v.allFinite() &&
               std::isfinite(sim.energy());
    for (const ContactReport& c : sim.contacts()) v.finite = v.finite && c.force.allFinite();
  }
  v.gain = balance.gain();
  v.share = balance.share();
  v.reached = sim.time();
  v.reason = toString(reason);
  v.evaluations = static_cast<double>(sim.counts().evaluations);
  return v;
}

/// Adds a random scene's data to `base` (config/scenarios/cell.yaml): geometry, clearance down to
/// zero, friction, stiffness and damping over decades, pose, speed, law, integrator, tolerance.
class RandomScene {
 public:
  RandomScene(const Scenario& base, unsigned seed) : scene(base), random_(seed) {
    Scenario& s = scene;
    const double size = decades(-1, 1);
    s.mechanism.peg.radius = 0.025 * size;
    s.mechanism.peg.half_height = s.mechanism.peg.radius * between(0.3, 2.0);
    s.mechanism.peg.mass = 0.395 * size * size * size * decades(-0.5, 0.5);
    s.mechanism.peg.inertia_transverse =
        s.mechanism.peg.mass * s.mechanism.peg.radius * s.mechanism.peg.radius * between(0.3, 2.0);
    s.mechanism.peg.inertia_axial = s.mechanism.peg.inertia_transverse * between(0.2, 1.5);
    s.mechanism.peg.coupling_height = s.mechanism.peg.half_height * between(0.5, 2.0);
    s.mechanism.peg.exciter_height = s.mechanism.peg.half_height * between(0.0, 2.0);
    const double clearance = chance(0.2) ? 0.0 : s.mechanism.peg.radius * decades(-5, -1);
    s.mechanism.hole.radius = s.mechanism.peg.radius + clearance;
    s.mechanism.hole.depth = s.mechanism.peg.half_height * between(0.2, 4.0);
    s.mechanism.carrier.mass = s.mechanism.peg.mass * decades(-1, 1);
    s.mechanism.carrier.inertia = s.mechanism.peg.inertia_axial * decades(-1, 2);
    const double weight = s.mechanism.peg.mass / (size * size);
    for (int i = 0; i < 3; ++i) {
      const double arm = i < 2 ? 1.0 : s.mechanism.peg.radius * s.mechanism.peg.radius;
      s.mechanism.carrier.stiffness(i) = chance(0.3) ? 0.0 : weight * arm * decades(2, 6);
      s.mechanism.carrier.damping(i) =
          chance(0.3)
              ? 0.0
              : std::sqrt(s.mechanism.carrier.stiffness(i) * s.mechanism.carrier.mass * arm) *
                    between(0, 1);
    }
    for (int i = 0; i < 6; ++i) {
      const double arm = i < 3 ? 1.0 : s.mechanism.peg.radius * s.mechanism.peg.radius;
      s.mechanism.coupling.stiffness.diagonal(i) = weight * arm * decades(1, 6);
      s.mechanism.coupling.damping.diagonal(i) =
          chance(0.3)
              ? 0.0
              : std::sqrt(s.mechanism.coupling.stiffness.diagonal(i) * s.mechanism.peg.mass * arm) *
                    between(0, 0.5);
    }
    const auto cross = [&](int i, int j) {
      return between(-0.8, 0.8) * std::sqrt(s.mechanism.coupling.stiffness.diagonal(i) *
                                            s.mechanism.coupling.stiffness.diagonal(j));
    };
    s.mechanism.coupling.stiffness.k26 = cross(1, 5);
    s.mechanism.coupling.stiffness.k35 = cross(2, 4);
    s.mechanism.coupling.damping.k26 = s.mechanism.coupling.damping.k35 = 0.0;
    s.mechanism.friction.static_coefficient = chance(0.1) ? 0.0 : between(0.0, 1.0);
    s.mechanism.friction.sliding_coefficient =
        s.mechanism.friction.static_coefficient * between(0.6, 1.0);
    s.mechanism.gravity = chance(0.2) ? 0.0 : 9.8;

    const double tilt = chance(0.1) ? 0.0 : decades(-4, -0.4), lean = between(-3.1416, 3.1416);
    const Eigen::Vector3d axis(std::sin(tilt) * std::cos(lean), std::sin(tilt) * std::sin(lean),
                               std::cos(tilt));
    const double away = s.mechanism.peg.radius * (chance(0.2) ? 0.0 : between(0.0, 1.2));
    const double round = between(-3.1416, 3.1416);
    const double height = s.mechanism.peg.radius * (std::sin(tilt) + decades(-6, -1));
    const Eigen::Vector3d bottom(away * std::cos(round), away * std::sin(round), height);
    s.initial = InitialState{};
    s.initial.euler = {std::atan2(axis.x(), axis.z()), std::acos(axis.y()), between(-1, 1)};
    s.initial.position = bottom + s.mechanism.peg.half_height * axis;
    const double speed = std::sqrt(9.8 * s.mechanism.peg.radius) * decades(-3, 0);
    for (int i = 0; i < 3; ++i) {
      s.initial.velocity(i) = speed * between(-1, 1);
      s.initial.euler_rates(i) = speed / s.mechanism.peg.radius * between(-1, 1);
    }
    s.initial.velocity.z() = -std::abs(s.initial.velocity.z());
    const Eigen::Vector3d coupling = s.initial.position + s.mechanism.peg.coupling_height * axis;
    s.initial.carrier_x = coupling.x();
    s.initial.carrier_y = coupling.y();
    s.rest = {coupling.x(),
              coupling.y(),
              coupling.z() - s.mechanism.peg.radius * decades(-5, -1),
              0.0,
              s.initial.euler.theta,
              s.initial.euler.phi};

    driven = chance(0.5);
    s.mechanism.exciter = ExciterParameters{};
    if (driven) {
      s.mechanism.exciter.amplitude = s.mechanism.peg.mass * 9.8 * decades(-2, 1);
      s.mechanism.exciter.frequency = decades(1, 3.5);
      s.mechanism.exciter.direction = chance(0.5) ? 1 : -1;
    }
    const ContactLaw laws[] = {ContactLaw::kSpringDashpot, ContactLaw::kViscous, ContactLaw::kRigid,
                               ContactLaw::kRigid};
    s.contact.law = laws[pick(4)];
    s.contact.stiffness = weight * decades(4, 7);
    s.contact.damping = std::sqrt(s.contact.stiffness * s.mechanism.peg.mass) * between(0, 1);
    s.contact.rate = decades(2, 4);
    // explicit steps of N mu / (m v): a smaller speed makes impacts stiff beyond patience
    s.contact.regularisation_speed = 1e-2 * size;
    s.contact.stationary_rows = chance(0.5);
    s.contact.restitution = s.contact.law == ContactLaw::kRigid && chance(0.3) ? between(0, 1) : 0;
    const char* const names[] = {"dopri5", "dopri5", "dop853", "rk4", "hamming"};
    s.solver.integrator = names[pick(5)];
    adaptive = s.solver.integrator[0] == 'd';
    s.solver.tolerance = size * decades(-11, -8);
    s.solver.step = decades(-5, -3.5);
    // the work of the viscous law's push is summed over steps
    s.solver.max_step = s.contact.law == ContactLaw::kViscous ? 1e-5 : 2e-4;
  }

  Scenario scene;
  bool driven = false, adaptive = true;

 private:
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double decades(double low, double high) { return std::pow(10.0, between(low, high)); }
  bool chance(double p) { return between(0, 1) < p; }
  std::size_t pick(std::size_t n) {
    return std::min(n - 1, static_cast<std::size_t>(between(0, 1) * static_cast<double>(n)));
  }
  std::mt19937_64 random_;
};

/// The energy of a run with error control is bounded by its tolerance; fixed steps may be unstable.
inline bool controlsError(const Scenario& s) {
  return s.solver.integrator != "rk4" && !(s.solver.integrator == "hamming" && s.solver.step > 0.0);
}

inline Verdict run(const RandomScene& r, double duration) {
  Verdict v = evaluate(r.scene, duration);
  const char* const laws[] = {"none", "spring_dashpot", "viscous", "rigid"};
  v.scene = std::string(laws[static_cast<int>(r.scene.contact.law)]) + " " +
            r.scene.solver.integrator + (r.driven ? ", driven" : "");
  if (!controlsError(r.scene)) v.gain = 0.0;
  return v;
}

}  // namespace assembly_cell::stress
