// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Steps of the integrators with frozen contact modes, and step size control.
#pragma once

#include <algorithm>

#include "evaluation.h"

namespace assembly_cell {

inline bool isFinite(const State& state) {
  return state.q.allFinite() && state.v.allFinite() && state.carrier_deflection.allFinite();
}

/// Event functions of the closed slots at the stages at 0.3 and 0.8 of a step of dopri5, accurate
/// to second order. HUGE_VAL: not defined for the slot's mode. Deliberately uninitialised (1.3 kB).
struct StageEvents {
  bool recorded = false;
  bool complete = false;  ///< usable for hiddenEvent(): all closed slots carry
  /// Slots that stick together; their internal forces are 0 here, as they are found at step ends.
  ContactSlotMask shared = 0;
  std::array<std::array<std::array<double, kEventKinds>, kSlots>, 2> value;
};

/// A trial step of length h from the context's state.
struct Trial {
  bool finite() const { return isFinite(end) && slope.allFinite(); }

  double h = 0.0;
  Method method = Method::kDopri5;  ///< method of this step
  State end;
  Vector9 slope;  ///< v' there
  Eigen::Vector3d carrier_deflection_rate =
      Eigen::Vector3d::Zero();  ///< rate of State::carrier_deflection there
  double error = 0.0;           ///< estimated, over the tolerance; 0 without error control
  StageEvents stages;
  Vector9 sixth = Vector9::Zero();  ///< coefficient of (u − u²)³ in interpolate(), from refine()
};

/// Weighted norm of an error of a state, over the tolerance.
double errorOf(const System& s, const State& error);

/// Dense output: the state at c.time + tau within a step from the context. Quintic Hermite
/// interpolation of position, velocity and acceleration at both ends (order six); cubic of the
/// carrier deflection (order four).
State interpolate(const Context& c, const Trial& step, double tau);

/// Raises the order of interpolate() by one, from v' in the middle of the step. Returns the maximum
/// change of the interpolant over the tolerance. e: of the middle.
double refine(const System& s, const Context& c, Trial& step, Evaluation& e);

/// A step of length step.h by a one-step method (kHamming: by its starting method). e: of the
/// step's end.
void attemptStep(const System& s, const Context& c, Method method, Trial& step, Evaluation& e);

/// The scenario's integrator with its history and step size.
class Integrator {
 public:
  /// The last accepted step.
  struct Accepted {
    double right = 0.0;  ///< step size with an error of the tolerance; 0: none yet [s]
    Method method = Method::kDopri5;
  };
  /// Step size state of a one-step method.
  struct Pace {
    std::int64_t decisions = -1;  ///< Context::decisions at the start of the history
    bool slow = false;            ///< the last step was by slow_slip.h
    int stiff = 0;                ///< consecutive steps limited by stability, not accuracy
    int explicit_left = 0;        ///< remaining steps without slow_slip.h after its failure
    double next_step = 0.0;       ///< [s]
    double refused = 0.0;         ///< error of the rejected step before; 0: it was accepted
    Accepted last;                ///< since the last change of contact modes
  };

  explicit Integrator(double first_step) { pace_.next_step = first_step; }
  const Pace& pace() const { return pace_; }
  /// Continues from `pace`. Not for the multistep method, which has a history.
  void resume(const Pace& pace) { pace_ = pace; }
  /// Length of the next step before limits by t_end [s].
  double nextStep(const System& s, const Context& c) const;
  /// Sets the length of the next step [s].
  void setStep(double h) { pace_.next_step = h; }

  /// Sets step.h to the length of the next step; true if the step ends at t_end.
  bool plan(const System& s, const Context& c, const Evaluation& e, double t_end, Trial& step);
  void attempt(const System& s, const Context& c, Trial& step, Evaluation& e);
  /// Factor of the step size after a rejected step.
  static double shrinkBy(const Trial& step);
  /// True if the step failed by its implicit equations; the next ones are explicit.
  bool fallBackToExplicit(const Trial& step);
  /// True if the error of a step by slow_slip.h is small and didn't fall with its length: slip of a
  /// jammed peg settles within a fraction of any step, and shorter ones gain nothing.
  bool stagnates(const Trial& step) const;
  /// After a rejected step: reduces the step size.
  void refuse(const System& s, const Context& c, const Trial& step, Evaluation& e);
  /// After an accepted step; c is at its end.
  void accept(const System& s, const Context& c, const Trial& step, bool last, double t_end);
  /// After a step that was shortened to end at an event.
  void interrupt() { bridging_ = false; }
  /// Sets the next step size from the error of the last step, and updates the choice of method.
  void lengthen(const System& s, const Context& c, const Trial& step, bool last, double t_end);

 private:
  // history of the multistep method: rows 0 (oldest) to count − 1 (present state)
  struct Past {
    static constexpr int kMaxRows = 7;
    std::array<State, kMaxRows> y, slope;
    State defect;  // predictor − corrector of the last step
    int count = 0;
    double h = 0.0;
  };

  bool needsSlowSlip(const System& s, const Context& c, double h) const;
  void note(const Context& c, const Trial& step);
  void attemptHamming(const System& s, const Context& c, Trial& step, Evaluation& e);
  void remember(const Context& c, double h);
  void resetDefect();
  void halvePast(const System& s, const Context& c, Evaluation& e);
  void doublePast();

  Past past_;
  State trial_defect_;
  bool bridging_ = false;  // hamming: a step of dopri5 over a state from which it can't start
  Pace pace_;
};

}  // namespace assembly_cell
