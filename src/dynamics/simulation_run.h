// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A run: its steps, and samples of the dense output of the last step.
#pragma once

#include <memory>

#include "context.h"
#include "integration/integrator.h"

namespace assembly_cell {

struct Simulation::Run {
  explicit Run(const Scenario& scenario);

  void step(double t_end);
  void refuse(const Trial& trial);
  /// Takes over the trial's end as the state at t [s]. True if the last evaluation is of that
  /// state.
  bool accept(double t, const Trial& trial);
  void endAtEvent(const Events& at_end, Trial& trial);
  void stepOverJump(const Trial& trial);
  void stopSlip();
  bool leap();
  void checkState();
  void decideAfterCommand();
  StopReason advance(double t_end, std::int64_t attempts);
  void sampleAt(double t, double ahead);
  void returnToSample();
  Evaluation afterCommand() const;
  /// Part of the evaluation at the sample that is up to date: none, free motion, contact forces.
  enum class Found { kNothing, kMotion, kForces };
  /// use(evaluation at the present time), evaluated as far as `needed`.
  template <class Use>
  auto atPresent(Found needed, const Use& use) const {
    if (sampling) {
      find(needed);
      return use(dense->now);
    }
    return context.stale ? use(afterCommand()) : use(now);
  }
  /// Evaluates the sample as far as `needed`.
  void find(Found needed) const;
  /// Modes and commands at the sample.
  const Context& sampled() const { return sampling ? dense->context : context; }

  System system;  // constant but for the friction, see setFriction()
  Context context;
  Evaluation now;     // the last one
  Evaluation inside;  // workspace: points within a step
  Integrator integrator;
  // Dense output of the last step: context at its start, and the sample taken of it.
  struct DenseOutput {
    Context context;
    Evaluation now;  // at the sample
    Integrator::Pace pace;
    Trial step;
    double time;
    State state;
    Found found;
    Vector9 slope;
  };
  std::unique_ptr<DenseOutput> dense;
  bool sampling = false;
};

}  // namespace assembly_cell
