// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Random scenes for stress runs and their judgement. Shared by test_random_scenes and the benchmark
// tool `stress`.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <string>

#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell::stress {

/// What a run was and what came of it.
struct Verdict {
  std::string scene;     ///< law, integrator and what else tells it
  std::string reason;    ///< how it ended
  double gain = 0.0;     ///< largest energy gain over the energy in play; undriven scenes only
  double seconds = 0.0;  ///< wall time
  double evaluations = 0.0;
  bool finite = true;  ///< state and energy stayed finite while the run said ok
  bool hung = false;   ///< took longer than kPatience
};

constexpr double kPatience = 60.0;  // [s] of wall time for a run of hundredths of a second

/// Runs for `duration`, watching energy and finiteness at 40 times.
inline Verdict judge(const Scenario& s, double duration, bool driven) {
  using Clock = std::chrono::steady_clock;
  Verdict v;
  const auto start = Clock::now();
  Simulation sim(s);
  const double before = sim.energy();
  double lowest = before;
  // what can move: kinetic and elastic energy, and the weight over a peg's length
  const double floor = s.mechanism.peg.mass * s.mechanism.gravity * sim.state().q(0);
  const double scale =
      std::abs(before - floor) +
      s.mechanism.peg.mass * s.mechanism.gravity * 2 * s.mechanism.peg.half_height +
      1e-6 * s.mechanism.peg.mass * s.mechanism.peg.radius * s.mechanism.peg.radius;
  StopReason reason = sim.stopReason();
  for (int i = 1; i <= 40 && reason == StopReason::kOk; ++i) {
    reason = sim.advance(duration * i / 40);
    if (reason != StopReason::kNonFinite) {
      v.finite = v.finite && sim.state().q.allFinite() && sim.state().v.allFinite() &&
                 std::isfinite(sim.energy());
      for (const ContactReport& c : sim.contacts()) v.finite = v.finite && c.force.allFinite();
      if (!driven) v.gain = std::max(v.gain, (sim.energy() - lowest) / scale);
      // a compliant contact gives back what it stored, a rigid one stores nothing
      if (s.contact.law == ContactLaw::kRigid) lowest = std::min(lowest, sim.energy());
    }
    v.seconds = std::chrono::duration<double>(Clock::now() - start).count();
    v.hung = v.seconds > kPatience;
    if (v.hung) break;
  }
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
    s.solver.max_step = 2e-4;
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

/// Energy gain allowed: error-controlled runs of laws that only take energy. The viscous law may
/// give some back while it holds a leaving point to its rate, fixed steps may be unstable.
inline bool energyCounts(const RandomScene& r) {
  return !r.driven && r.adaptive && r.scene.contact.law != ContactLaw::kViscous;
}
// Of the energy in play. Error control bounds positions, not energy, and closed gaps are put to
// zero after each step; what friction and dampers take is more. No scene of 6000
// gained more than 1e-7.
constexpr double kGain = 1e-6;

inline Verdict run(const RandomScene& r, double duration) {
  Verdict v = judge(r.scene, duration, r.driven);
  const char* const laws[] = {"none", "spring_dashpot", "viscous", "rigid"};
  v.scene =
      std::string(laws[static_cast<int>(r.scene.contact.law)]) + " " + r.scene.solver.integrator;
  if (!energyCounts(r)) v.gain = 0.0;
  return v;
}

}  // namespace assembly_cell::stress
