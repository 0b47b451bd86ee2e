// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A run: how it steps, and how it is looked at within a step.
#pragma once

#include <memory>

#include "context.h"
#include "integrator.h"

namespace assembly_cell {

struct Simulation::Run {
  explicit Run(const Scenario& scenario);

  void step(double t_end);
  void refuse(const Trial& trial);
  void accept(double t, const Trial& trial);
  void endAtEvent(const Events& at_end, Trial& trial);
  void checkState();
  void decideAfterCommand();
  void followForce();
  StopReason advance(double t_end, std::int64_t attempts);
  void look(double t, double ahead);
  void comeBack();
  Evaluation afterCommand() const;
  /// What `use` makes of the evaluation of the present.
  template <class Use>
  auto atPresent(const Use& use) const {
    if (looks) return use(behind->now);
    return context.stale ? use(afterCommand()) : use(now);
  }
  /// Where the run is, or within the last step.
  const Context& shown() const { return looks ? behind->context : context; }

  const System system;
  Context context;
  Evaluation now;  // the last one
  Integrator integrator;
  // While the world is looked at within the last step: what was at its start, but time and state,
  // which are those that are looked at; and where the step began and ended.
  struct Behind {
    Context context;
    Evaluation now;
    Integrator integrator;
    double start = 0.0;
    State state;
    Vector9 slope;
    Trial step;
  };
  std::unique_ptr<Behind> behind;
  bool looks = false;
};

}  // namespace assembly_cell
