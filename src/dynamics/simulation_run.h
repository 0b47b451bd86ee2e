// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A run: how it steps, and how it is looked at within a step.
#pragma once

#include <memory>

#include "context.h"
#include "integration/integrator.h"

namespace assembly_cell {

struct Simulation::Run {
  explicit Run(const Scenario& scenario);

  void step(double t_end);
  void refuse(const Trial& trial);
  /// True where the last evaluation is of the state that it leaves.
  bool accept(double t, const Trial& trial);
  void endAtEvent(const Events& at_end, Trial& trial);
  void endUnseen(const Trial& trial);
  void stopSlip();
  bool leap();
  void checkState();
  void decideAfterCommand();
  StopReason advance(double t_end, std::int64_t attempts);
  void look(double t, double ahead);
  void comeBack();
  Evaluation afterCommand() const;
  /// What is known of a state within a step: nothing yet, its free motion, its contacts, too.
  enum class Found { kNothing, kMotion, kForces };
  /// What `use` makes of the evaluation of the present, of which it needs so much.
  template <class Use>
  auto atPresent(Found needed, const Use& use) const {
    if (looks) {
      find(needed);
      return use(behind->now);
    }
    return context.stale ? use(afterCommand()) : use(now);
  }
  /// Of what is looked at.
  void find(Found needed) const;
  /// Modes and commands of what is looked at.
  const Context& shown() const { return looks ? behind->context : context; }

  const System system;
  Context context;
  Evaluation now;     // the last one
  Evaluation inside;  // workspace: within a step
  Integrator integrator;
  // The last step that may be looked into: what was at its start, and what of it is looked at.
  struct Behind {
    Context context;
    Evaluation now;  // of what is looked at
    Integrator::Pace pace;
    Trial step;
    double time;
    State state;
    Found found;
    Vector9 slope;
  };
  std::unique_ptr<Behind> behind;
  bool looks = false;
};

}  // namespace assembly_cell
