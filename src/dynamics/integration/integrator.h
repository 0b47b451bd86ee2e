// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Steps of the four integrators, with the modes of the contacts frozen, and their length.
#pragma once

#include <algorithm>

#include "evaluation.h"

namespace assembly_cell {

inline bool isFinite(const State& state) {
  return state.q.allFinite() && state.v.allFinite() && state.give.allFinite();
}

/// Event functions of the closed slots at the stages at 0.3 and 0.8 of a step of dopri5, off by
/// their third order. HUGE_VAL: not that of the slot. Unset where not noted, of open slots: 1.3 kB.
struct StageEvents {
  bool noted = false;
  bool told = false;  ///< they tell of events in between: all slots carry
  /// Slots that stick beside each other: what these share is found at a step's end, here it is 0.
  ContactSlotMask shared = 0;
  std::array<std::array<std::array<double, kEventKinds>, kSlots>, 2> value;
};

/// A step of length h from the context's state, tried.
struct Trial {
  bool finite() const { return isFinite(end) && slope.allFinite(); }

  double h = 0.0;
  Method method = Method::kDopri5;  ///< that tried it
  State end;
  Vector9 slope;                                        ///< v' there
  Eigen::Vector3d give_rate = Eigen::Vector3d::Zero();  ///< of State::give there
  double error = 0.0;  ///< over the tolerance; 0 without error control
  StageEvents stages;
  Vector9 sixth = Vector9::Zero();  ///< of interpolate(), from refine(): coefficient of (u − u²)³
};

/// An error of a state over the tolerance.
double errorOf(const System& s, const State& error);

/// The state at c.time + tau within a step from the context: position, velocity and acceleration at
/// both ends make one polynomial of order six. What gives way has one of order four.
State interpolate(const Context& c, const Trial& step, double tau);

/// One order more for interpolate(), by the slope in the middle of the step; what that changes at
/// most, over the tolerance. e: of the middle.
double refine(const System& s, const Context& c, Trial& step, Evaluation& e);

/// A step of length step.h by a one-step method (kHamming: of the method that starts it). e: of its
/// end.
void attemptStep(const System& s, const Context& c, Method method, Trial& step, Evaluation& e);

/// The scenario's integrator: its past and its step size.
class Integrator {
 public:
  /// What is known of the last step that was taken.
  struct Accepted {
    double right = 0.0;  ///< step whose error would have been the tolerance; 0: none yet [s]
    Method method = Method::kDopri5;
  };
  /// What a one-step method goes on with.
  struct Pace {
    std::int64_t decisions = -1;  ///< of the context when the past began
    bool slow = false;            ///< the last step was by slow_slip.h
    int stiff = 0;                ///< steps in a row as long as stability, not accuracy, allows
    int explicit_left = 0;        ///< steps without slow_slip.h, which has just failed
    double next_step = 0.0;       ///< [s]
    Accepted last;                ///< since the contacts changed
  };

  explicit Integrator(double first_step) { pace_.next_step = first_step; }
  const Pace& pace() const { return pace_; }
  /// Goes on from there. Not with a multistep method, which has a past.
  void resume(const Pace& pace) { pace_ = pace; }
  /// Length of the next step, where nothing ends it [s].
  double nextStep(const System& s, const Context& c) const;
  /// From now on steps of at most this length, until they grow by themselves [s].
  void setStep(double h) { pace_.next_step = h; }

  /// Sets step.h to the next step to take; true where it ends at t_end.
  bool plan(const System& s, const Context& c, const Evaluation& e, double t_end, Trial& step);
  void attempt(const System& s, const Context& c, Trial& step, Evaluation& e);
  /// Factor of the step to try after a failed one.
  static double shrinkBy(const Trial& step);
  /// The step found no direction of slow slip: an explicit one next (true).
  bool goesExplicit(const Trial& step);
  /// The step was refused: a shorter one next.
  void refuse(const System& s, const Context& c, const Trial& step, Evaluation& e);
  /// The step was accepted as it was tried, c is at its end.
  void accept(const System& s, const Context& c, const Trial& step, bool last, double t_end);
  /// The step was cut short by an event.
  void interrupt() { bridging_ = false; }
  /// The next step as the last one's error asks for, and what its method depends on.
  void lengthen(const System& s, const Context& c, const Trial& step, bool last, double t_end);

 private:
  // the past of a multistep method: rows 0 (oldest) to count − 1 (present state)
  struct Past {
    static constexpr int kMaxRows = 7;
    std::array<State, kMaxRows> y, slope;
    State defect;  // predictor less corrector of the last step
    int count = 0;
    double h = 0.0;
  };

  bool goesSlow(const System& s, const Context& c, double h) const;
  void note(const Context& c, const Trial& step);
  void attemptHamming(const System& s, const Context& c, Trial& step, Evaluation& e);
  void remember(const Context& c, double h);
  void resetDefect();
  void halvePast(const System& s, const Context& c, Evaluation& e);
  void doublePast();

  Past past_;
  State trial_defect_;
  bool bridging_ = false;  // hamming: one step of dopri5, past what it can't start in
  Pace pace_;
};

}  // namespace assembly_cell
