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
#include "integration/chatter.h"
#include "integration/event_locator.h"

namespace assembly_cell {
namespace {

// A rigid flat peg that asks for shorter steps is stepped over: a hundredth of the usual ones. Half
// and twice: 19 and 21 of 400 random scenes end elsewhere, effort within 1 %; Chapter 8 moves by 2
// nm.
constexpr double kShortest = 2e-6;  // [s]
// Where its face can lie its lowest point is followed to an event's resolution.
constexpr double kShortestOnGround = 1e-12;  // [s]
// No result changes at half or twice of these.
constexpr double kStepFloor =
    1e-13;  // error control below this gives up: a tenth of kEventTime [s]
// Where it gives up contacts are found anew this far on, twice as far each time soon after another.
constexpr double kLeap = 1e-12, kFarthestLeap = 1e-8, kSoon = 1e-6;  // [s]
constexpr double kAfterJam = 1e-6;  // the first step after a jam, grows from there [s]
// Slip goes astray, too, where so many steps in a row are shorter than that: forces jump to and fro
// between two values, and a run would take 1e9 of them. After an event a dozen are.
constexpr double kCrawl = 1e-10;  // [s]
constexpr int kMostCrawling = 300;
constexpr double kMinSine = 0.1;  // of theta: the Euler angles are singular at 0
constexpr std::int64_t kEventLimit = 10000000;
constexpr double kSameEnd = 1e-14;  // rounding of a sum of steps, a part of the time

// a contact that `features` excludes ends the run
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

// one attempt at a step towards t_end
void Simulation::Run::step(double t_end) {
  Trial trial;
  const bool last = integrator.plan(system, context, now, t_end, trial);
  const double t = last ? t_end : context.time + trial.h;
  const bool chatters = context.time < context.chatter_until;
  now.coarse = chatters;
  if (chatters && system.rigid) {
    takeChatterStep(system, t, context, now);
    return checkState();
  }
  integrator.attempt(system, context, trial, now);
  // springs that are found and lost in turn; other laws would gain from such steps. The last step
  // before t_end is longer by a rounding
  const bool coarse = chatters && hasSprings(system) && trial.h <= 1.01 * kMinChatterStep;
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
  if (!last) context.crawling = trial.h < kCrawl ? context.crawling + 1 : 0;
  const bool crawls = context.crawling > kMostCrawling && !system.fixed_step;
  if (crawls && system.rigid && slips(context.slots)) {
    context.crawling = 0;
    stopSlip();
  }
  checkState();
}

// a step that failed: a shorter one next, or the end of the run
void Simulation::Run::refuse(const Trial& trial) {
  ++context.counts.rejected;
  if (integrator.goesExplicit(trial)) return;
  const bool finite = trial.finite();
  const double shorter = trial.h * Integrator::shrinkBy(trial);
  const bool lies = system.rigid && mayLie(system, now.edge);
  if (!system.fixed_step && shorter < (lies ? kShortestOnGround : kShortest) && finite &&
      system.rigid && isFlat(now) && !context.face.on && context.time >= context.chatter_until) {
    if (lies) return endUnseen(trial);
    // the lowest point of a flat peg changes at once: step over that
    beginChatter(context.time, context);
  } else if (system.rigid && finite && shorter < kStepFloor && slips(context.slots)) {
    stopSlip();
  } else if (system.fixed_step || shorter < kStepFloor) {
    if (finite && system.discrete_friction && !system.fixed_step && leap()) return;
    context.stop = finite ? StopReason::kStepTooSmall : StopReason::kNonFinite;
  } else {
    integrator.refuse(system, context, trial, now);
  }
}

// slip that goes astray: there is no force that it can go on with
void Simulation::Run::stopSlip() {
  ++context.counts.events;
  noteEvent(system, now, context.time, context);
  jam(system, false, context, now);
  decide(system, context, now);
  integrator.setStep(kAfterJam);
}

bool Simulation::Run::accept(double t, const Trial& trial) {
  if (behind) behind->step = trial;
  context.time = t;
  context.state = trial.end;
  context.slope = trial.slope;
  context.give_rate = trial.give_rate;
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

// A point of a flat peg that jumps within less than an event's resolution: contacts are found anew
// behind it.
void Simulation::Run::endUnseen(const Trial& trial) {
  integrator.interrupt();
  const double t = context.time + trial.h;
  const double limit = system.rigid ? energyOf(system, context, now) : HUGE_VAL;
  noteEvent(system, now, t, context);
  accept(t, trial);
  ++context.counts.events;
  findModesWithin(system, limit, context, now);
  checkState();
}

// Two points of contact come together or part, and their forces jump between what one carries and
// what a pair does: past that, to where contacts are found anew. False where that hasn't helped.
bool Simulation::Run::leap() {
  context.leap = context.time - context.leapt < kSoon ? 2.0 * context.leap : kLeap;
  if (context.leap > kFarthestLeap) return false;
  Trial step;
  step.h = context.leap;
  step.end = context.state;
  step.end.q += step.h * context.state.v;
  step.end.give += step.h * context.give_rate;
  step.slope = context.slope;
  step.give_rate = context.give_rate;
  endUnseen(step);
  context.leapt = context.time;
  integrator.setStep(kAfterJam);
  return true;
}

void Simulation::Run::endAtEvent(const Events& at_end, Trial& trial) {
  integrator.interrupt();
  locateEvent(system, context, at_end, trial, now);
  const double t = context.time + trial.h;
  noteEvent(system, now, t, context);
  now.present = accept(t, trial);
  ++context.counts.events;
  changeModes(system, context, now);
  if (context.counts.events > kEventLimit) {
    context.stop = StopReason::kEventLimit;
  } else {
    checkState();
  }
}

// what ends a run after a step
void Simulation::Run::checkState() {
  if (std::sin(context.state.q(4)) < kMinSine) {
    context.stop = StopReason::kSingular;
  } else if (system.admitted) {
    context.stop = excludedContact(system, now);
  }
}

// forces jump with the commands: decide anew who slides
void Simulation::Run::decideAfterCommand() {
  if (context.stale && !(system.rigid && context.time < context.chatter_until)) {
    decide(system, context, now);
  }
}

// of the present, after a command and before the run goes on
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

// Steps until t is reached or passed, then shows t.
void Simulation::Run::look(double t, double ahead) {
  if (context.stop == StopReason::kOk) decideAfterCommand();
  if (!behind)
    behind = std::make_unique<Behind>(
        Behind{context, now, integrator.pace(), {}, 0.0, {}, Found::kNothing, {}});
  Behind& b = *behind;
  // steps end beside times that are looked at, by rounding
  const double resolution = kSameEnd * std::max(1.0, t);
  while (context.time < t - resolution && context.stop == StopReason::kOk) {
    if (integrator.nextStep(system, context) <= t - context.time + resolution ||
        context.time < context.chatter_until) {
      // it ends at t or before; of first order amid chatter, what is within isn't known
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
  looks = t < context.time - resolution;
  if (looks) {
    b.time = t;
    b.state = interpolate(b.context, b.step, t - b.context.time);
    b.found = Found::kNothing;
  } else if (context.time <= t + resolution && t <= context.time + resolution) {
    context.time = t;
  }
}

// The wrench in the coupling needs no contacts: they are found where somebody asks for them.
void Simulation::Run::find(Found needed) const {
  Behind& b = *behind;
  if (b.found >= needed) return;
  b.found = needed;
  if (needed == Found::kMotion) {
    evaluateFree(system, b.context.commands, b.time, b.state, b.now);
  } else {
    b.slope = evaluate(system, b.context, b.time, b.state, Level::kForces, b.now);
  }
}

// Before a command: the last step ends where it is looked at.
void Simulation::Run::comeBack() {
  if (!looks) return;
  looks = false;
  const std::int64_t count = now.count;
  context = behind->context;
  now = behind->now;
  now.count = count;
  integrator.resume(behind->pace);
  advance(behind->time, std::numeric_limits<std::int64_t>::max());
}

}  // namespace assembly_cell
