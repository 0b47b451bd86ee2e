// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <functional>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell::peers {

/// Positions, then rates, each over how the package weighs its error: 1, angles 30 rad/m, rates 30
/// 1/s times that.
using OdeintState = std::array<double, 18>;

/// A run of Boost.Odeint on the package's free equations (`freeMotion`, `solveMass`).
class OdeintRun {
 public:
  /// The scenario must stay.
  OdeintRun(const Scenario& scenario, const State& start)
      : s_(scenario),
        inverse_mass_(scenario.mechanism),
        drive_{scenario.mechanism.exciter, 0.0},
        rest_(restMotion(restProfile(scenario.rest), 0.0)) {
    for (std::size_t i = 0; i < 9; ++i) {
      y_[i] = start.q(static_cast<int>(i)) / scale(i);
      y_[i + 9] = start.v(static_cast<int>(i)) / scale(i + 9);
    }
  }

  /// Centre of mass at t_end, thesis axes [m]. tolerance: absolute error of a step [m].
  template <typename Stepper>
  Eigen::Vector3d advance(double t_end, double tolerance) {
    namespace odeint = boost::numeric::odeint;
    auto stepper = odeint::make_controlled(tolerance, 0.0, Stepper());
    while (t_ < t_end) {
      const double asked = std::min(h_, t_end - t_);
      const bool shortened = asked < h_;
      double next = asked;
      const bool taken = stepper.try_step(std::ref(*this), y_, t_, next) == odeint::success;
      if (taken) ++steps;
      if (taken && shortened && t_ >= t_end * (1.0 - 1e-15)) {
        t_ = t_end;
        break;
      }
      h_ = next;
    }
    return {y_[0], y_[1], y_[2]};
  }

  void operator()(const OdeintState& y, OdeintState& dy, double t) {
    ++evaluations;
    State state;
    for (std::size_t i = 0; i < 9; ++i) {
      state.q(static_cast<int>(i)) = y[i] * scale(i);
      state.v(static_cast<int>(i)) = y[i + 9] * scale(i + 9);
    }
    const Kinematics k = kinematics(state);
    FreeMotion motion;
    freeMotion(s_, k, state, rest_, exciterForce(drive_, t), motion);
    Vector9 a;
    solveMass(inverse_mass_, k, motion.force, a);
    for (std::size_t i = 0; i < 9; ++i) {
      dy[i] = state.v(static_cast<int>(i)) / scale(i);
      dy[i + 9] = a(static_cast<int>(i)) / scale(i + 9);
    }
  }

  long long evaluations = 0, steps = 0;

 private:
  static double scale(std::size_t i) {
    const std::size_t j = i % 9;
    return (j > 2 && j != 6 && j != 7 ? 30.0 : 1.0) * (i > 8 ? 30.0 : 1.0);
  }

  const Scenario& s_;
  InverseMass inverse_mass_;
  Drive drive_;
  RestMotion rest_;
  OdeintState y_{};
  double t_ = 0.0, h_ = 1e-4;
};

}  // namespace assembly_cell::peers
