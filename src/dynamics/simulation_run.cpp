// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "simulation_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/contact_modes.h"
#include "contact/contact_solver.h"
#include "contact/contact_tolerances.h"
#include "contact/slow_slip.h"
#include "face/face_edge.h"
#include "impact/impact.h"
#include "integration/event_locator.h"
#include "integration/zeno.h"

namespace assembly_cell {
namespace {

// Step size below which a Zeno phase begins for a rigid flat peg: a hundredth of the usual ones.
// Half and twice: 19 and 21 of 400 random scenes end elsewhere, effort within 1 %; Chapter 8 moves
// by 2 nm.
constexpr double kShortest = 2e-6;  // [s]
// Shortest step where the peg's face can rest: the resolution of an event.
constexpr double kShortestOnGround = 1e-12;  // [s]
// No result changes at half or twice of these.
constexpr double kStepFloor =
    1e-13;  // step size at which error control fails: a tenth of kEventTime [s]
// Step over a discontinuity where error control fails; doubled if the last one is less than kSoon
// ago.
constexpr double kLeap = 1e-12, kMaxLeap = 1e-8, kSoon = 1e-6;  // [s]
constexpr double kAfterPainleve = 1e-6;  // first step after a Painlevé impact [s]
// Slip is inconsistent, too, after so many consecutive steps below kShortStep: forces alternate
// between two values. After an event a dozen steps are as short.
constexpr double kShortStep = 1e-10;  // [s]
constexpr int kMaxShortSteps = 300;
// Error that a step counts with where shorter ones have no smaller one: the next is longer.
constexpr double kSettled = 0.1;
constexpr double kMinSine = 0.1;  // of theta: the Euler angles are singular at 0
constexpr std::int64_t kEventLimit = 10000000;
constexpr double kSameEnd = 1e-14;  // rounding of a sum of steps, relative to the time

// kOk, or the reason by a closed contact of an excluded feature
StopReason excludedContact(const System& s, const Evaluation& e) {
  if (e.closed_set.top_reached || e.open_set.top_reached) return StopReason::kPegTop;
  const ContactSlotMask found = e.closed & s.excluded & ~e.face;
  if (!found) return StopReason::kOk;
  static constexpr StopReason kReasons[] = {
      StopReason::kEdgeEdge, StopReason::kEdgePlane, StopReason::kEdgeWall, StopReason::kRimSide,
      StopReason::kRimFace,  StopReason::kEdgeCone,  StopReason::kRimCone};
  return kReasons[static_cast<int>(featureOfSlot(__builtin_ctz(found)))];
}

}  // namespace

Simulation::Run::Run(const Scenario& scenario)
    : system(scenario),
      context(system),
      now(system),
      inside(system),
      integrator(scenario.solver.max_step) {
  context.state = initialState(system);
  if (!isFinite(context.state)) {
    context.stop = StopReason::kNonFinite;
  } else if (std::sin(context.state.q(4)) < kMinSine) {
    context.stop = StopReason::kSingular;
  } else {
    findModes(system, true, context, now);
  }
}

// One trial step towards t_end.
void Simulation::Run::step(double t_end) {
  Trial trial;
  const bool last = integrator.plan(system, context, now, t_end, trial);
  const double t = last ? t_end : context.time + trial.h;
  const bool chatters = context.time < context.zeno_until;
  now.coarse = chatters;
  if (chatters && system.rigid) {
    takeTimeSteppingStep(system, t, context, now);
    return checkState();
  }
  integrator.attempt(system, context, trial, now);
  // steps with a larger error are accepted of springs that close and open alternately; with other
  // laws they would add energy. The last step before t_end is longer by a rounding
  const bool coarse = chatters && hasSprings(system) && trial.h <= 1.01 * kMinZenoStep;
  if (integrator.stagnates(trial)) trial.error = kSettled;
  if (!trial.finite() || !(trial.error <= 1.0 || coarse)) return refuse(trial);
  if (chatters) {
    const bool off = trial.error > 1.0;
    const double before = off ? energyOf(system, context, now) : 0.0;
    accept(t, trial);
    integrator.lengthen(system, context, trial, last, t_end);
    if (off) limitEnergy(system, before, context, now);
    findModes(system, false, context, now);
    return checkState();
  }
  if (system.admitted && !now.clear) {
    const Events at_end = eventValues(system, context, now);
    if (!std::all_of(at_end.begin(), at_end.end(), [](double value) { return value >= 0.0; })) {
      return endAtEvent(at_end, trial);
    }
    if (const double tau = hiddenEvent(system, context, trial, at_end, now, inside); tau > 0.0) {
      ++context.counts.rejected;
      return integrator.setStep(tau);
    }
  }
  accept(t, trial);
  integrator.accept(system, context, trial, last, t_end);
  if (!last) context.short_steps = trial.h < kShortStep ? context.short_steps + 1 : 0;
  const bool stalls = context.short_steps > kMaxShortSteps && !system.fixed_step;
  if (stalls && system.rigid && slips(context.slots)) {
    context.short_steps = 0;
    stopSlip();
  }
  checkState();
}

// Rejects a trial step: reduces the step size, or ends the run.
void Simulation::Run::refuse(const Trial& trial) {
  ++context.counts.rejected;
  if (integrator.fallBackToExplicit(trial)) return;
  const bool finite = trial.finite();
  const double shorter = trial.h * Integrator::shrinkBy(trial);
  const bool lies = system.rigid && canRestOnFace(system, now.edge);
  if (!system.fixed_step && shorter < (lies ? kShortestOnGround : kShortest) && finite &&
      system.rigid && isFlat(now) && !context.face.on && context.time >= context.zeno_until) {
    if (lies) return stepOverJump(trial);
    // the lowest point of a flat peg jumps
    beginZenoPhase(context.time, context);
  } else if (system.rigid && finite && shorter < kStepFloor && slips(context.slots)) {
    stopSlip();
  } else if (system.fixed_step || shorter < kStepFloor) {
    if (finite && system.discrete_friction && !system.fixed_step && leap()) return;
    context.stop = finite ? StopReason::kStepTooSmall : StopReason::kNonFinite;
  } else {
    integrator.refuse(system, context, trial, now);
  }
}

// Ends slip for which no consistent force exists, by a Painlevé impact.
void Simulation::Run::stopSlip() {
  ++context.counts.events;
  recordEvent(system, now, context.time, context);
  painleveImpact(system, false, context, now);
  decide(system, context, now);
  integrator.setStep(kAfterPainleve);
}

bool Simulation::Run::accept(double t, const Trial& trial) {
  if (dense) dense->step = trial;
  context.time = t;
  context.state = trial.end;
  context.slope = trial.slope;
  context.carrier_deflection_rate = trial.carrier_deflection_rate;
  ++context.counts.steps;
  if (!system.admitted) return true;
  if (trial.method == Method::kSlowSlip) followSlip(system, context, now);
  if (now.clear) {
    context.clearance -= now.moved;
    context.edge_speed = now.speed;
    return false;
  }
  updateSlots(system, context, now);
  const bool moved = system.rigid && project(system, context, now);
  beginStep(system, context, now);
  return !moved;
}

// Ends the step without locating an event (a point of a flat peg jumps within less than the
// resolution of an event) and finds all modes again.
void Simulation::Run::stepOverJump(const Trial& trial) {
  integrator.interrupt();
  const double t = context.time + trial.h;
  const double limit = system.rigid ? energyOf(system, context, now) : HUGE_VAL;
  recordEvent(system, now, t, context);
  accept(t, trial);
  ++context.counts.events;
  findModesWithin(system, limit, context, now);
  checkState();
}

// Steps over a discontinuity of the forces where two contact points merge or separate, and finds
// all modes again. False if the step would exceed kMaxLeap.
bool Simulation::Run::leap() {
  context.leap = context.time - context.leapt < kSoon ? 2.0 * context.leap : kLeap;
  if (context.leap > kMaxLeap) return false;
  Trial step;
  step.h = context.leap;
  step.end = context.state;
  step.end.q += step.h * context.state.v;
  step.end.carrier_deflection += step.h * context.carrier_deflection_rate;
  step.slope = context.slope;
  step.carrier_deflection_rate = context.carrier_deflection_rate;
  stepOverJump(step);
  context.leapt = context.time;
  integrator.setStep(kAfterPainleve);
  return true;
}

void Simulation::Run::endAtEvent(const Events& at_end, Trial& trial) {
  integrator.interrupt();
  locateEvent(system, context, at_end, trial, now);
  const double t = context.time + trial.h;
  recordEvent(system, now, t, context);
  now.present = accept(t, trial);
  ++context.counts.events;
  changeModes(system, context, now);
  if (context.counts.events > kEventLimit) {
    context.stop = StopReason::kEventLimit;
  } else {
    checkState();
  }
}

// Sets the stop reason after a step.
void Simulation::Run::checkState() {
  if (std::sin(context.state.q(4)) < kMinSine) {
    context.stop = StopReason::kSingular;
  } else if (system.admitted) {
    context.stop = excludedContact(system, now);
  }
}

// Forces jump with the commands: modes are decided again.
void Simulation::Run::decideAfterCommand() {
  if (context.stale && !(system.rigid && context.time < context.zeno_until)) {
    decide(system, context, now);
  }
}

// Evaluation at the present time after a command, before the next step.
Evaluation Simulation::Run::afterCommand() const {
  Evaluation e = now;
  evaluate(system, context, context.time, context.state, Level::kEvents, e);
  e.closed_set = now.closed_set;
  e.open_set = now.open_set;
  return e;
}

StopReason Simulation::Run::advance(double t_end, std::int64_t attempts) {
  if (context.stop != StopReason::kOk) return context.stop;
  decideAfterCommand();
  while (context.time < t_end && context.stop == StopReason::kOk && attempts-- > 0) step(t_end);
  return context.stop;
}

// Steps until t is reached or passed, then samples t.
void Simulation::Run::sampleAt(double t, double ahead) {
  if (context.stop == StopReason::kOk) decideAfterCommand();
  if (!dense)
    dense = std::make_unique<DenseOutput>(
        DenseOutput{context, now, integrator.pace(), {}, 0.0, {}, Found::kNothing, {}});
  DenseOutput& b = *dense;
  // ends of steps differ from sample times by rounding
  const double resolution = kSameEnd * std::max(1.0, t);
  while (context.time < t - resolution && context.stop == StopReason::kOk) {
    if (integrator.nextStep(system, context) <= t - context.time + resolution ||
        context.time < context.zeno_until) {
      // ends at t or before; steps of a Zeno phase are of first order and have no dense output
      step(t);
      continue;
    }
    if (b.context.time != context.time || b.context.decisions != context.decisions) {
      b.context = context;
      if (now.closed) {
        b.now = now;
      } else {
        b.now.closed = 0;
      }
      b.now.near = now.near;
      b.pace = integrator.pace();
    }
    step(ahead);
  }
  sampling = t < context.time - resolution;
  if (sampling) {
    b.time = t;
    b.state = interpolate(b.context, b.step, t - b.context.time);
    b.found = Found::kNothing;
  } else if (context.time <= t + resolution && t <= context.time + resolution) {
    context.time = t;
  }
}

// Contacts are evaluated on demand only: the wrench in the coupling does not need them.
void Simulation::Run::find(Found needed) const {
  DenseOutput& b = *dense;
  if (b.found >= needed) return;
  b.found = needed;
  if (needed == Found::kMotion) {
    evaluateFree(system, b.context.commands, b.time, b.state, b.now);
  } else {
    b.slope = evaluate(system, b.context, b.time, b.state, Level::kForces, b.now);
  }
}

// Before a command: the run returns to the sampled time, the rest of the step is discarded.
void Simulation::Run::returnToSample() {
  if (!sampling) return;
  sampling = false;
  const std::int64_t count = now.count;
  context = dense->context;
  now = dense->now;
  now.count = count;
  integrator.resume(dense->pace);
  advance(dense->time, std::numeric_limits<std::int64_t>::max());
}

}  // namespace assembly_cell
