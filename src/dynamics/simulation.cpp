// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/simulation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "chatter.h"
#include "contact_modes.h"
#include "contact_solver.h"
#include "contact_tolerances.h"
#include "context.h"
#include "event_locator.h"
#include "face.h"
#include "impact.h"
#include "integrator.h"
#include "slow_slip.h"

namespace assembly_cell {
namespace {

// A rigid flat peg that asks for shorter steps is stepped over: a hundredth of the usual ones. Half
// and twice: 19 and 21 of 400 random scenes end elsewhere, effort within 1 %; Chapter 8 moves by 2
// nm.
constexpr double kShortest = 2e-6;  // [s]
// So is one that comes down flat where its face can lie, as the last resort.
constexpr double kShortestOnGround = 1e-12;  // [s]
// No result changes at half or twice of these.
constexpr double kStepFloor =
    1e-13;                          // error control below this gives up: a tenth of kEventTime [s]
constexpr double kAfterJam = 1e-6;  // the first step after a jam, grows from there [s]
constexpr double kMinSine = 0.1;    // of theta: the Euler angles are singular at 0
constexpr std::int64_t kEventLimit = 10000000;
constexpr double kSameTime = 1e-9;  // rounding of sums of slices [s]
using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;

// a contact that `features` excludes ends the run
StopReason excludedContact(const System& s, const Evaluation& e) {
  if (e.closed_set.top_reached || e.open_set.top_reached) return StopReason::kPegTop;
  const ContactSlotMask found = e.closed & s.excluded & ~e.material;
  if (!found) return StopReason::kOk;
  static constexpr StopReason kReasons[] = {
      StopReason::kEdgeEdge, StopReason::kEdgePlane, StopReason::kEdgeWall, StopReason::kRimSide,
      StopReason::kRimFace,  StopReason::kEdgeCone,  StopReason::kRimCone};
  return kReasons[static_cast<int>(featureOfSlot(__builtin_ctz(found)))];
}

}  // namespace

const char* toString(StopReason reason) {
  static constexpr const char* kNames[] = {"ok",
                                           "edge_edge",
                                           "edge_plane",
                                           "edge_wall",
                                           "rim_side",
                                           "rim_face",
                                           "edge_cone",
                                           "rim_cone",
                                           "peg_top",
                                           "singular_orientation",
                                           "initial_overlap",
                                           "non_finite",
                                           "step_too_small",
                                           "event_limit"};
  return kNames[static_cast<int>(reason)];
}

struct Simulation::Run {
  explicit Run(const Scenario& scenario);

  void step(double t_end);
  void refuse(const Trial& trial);
  void accept(double t, const Trial& trial);
  void endAtEvent(const Events& at_end, Trial& trial);
  void checkState();
  void decideAfterCommand();
  void followForce();
  Evaluation afterCommand() const;
  /// What `use` makes of the evaluation of the present.
  template <class Use>
  auto atPresent(const Use& use) const {
    return context.stale ? use(afterCommand()) : use(now);
  }

  const System system;
  Context context;
  Evaluation now;  // the last one
  Integrator integrator;
};

Simulation::Run::Run(const Scenario& scenario)
    : system(scenario), context(system), integrator(scenario.solver.max_step) {
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
  if (chatters && system.rigid) {
    takeChatterStep(system, t, context, now);
    return checkState();
  }
  integrator.attempt(system, context, trial, now);
  if (!trial.finite() || !(trial.error <= 1.0)) return refuse(trial);
  if (chatters) {
    accept(t, trial);
    integrator.lengthen(system, context, trial, last, t_end);
    findModes(system, false, context, now);
    return checkState();
  }
  if (system.admitted && !now.clear) {
    const Events at_end = eventValues(system, context, now);
    if (!std::all_of(at_end.begin(), at_end.end(), [](double value) { return value >= 0.0; })) {
      return endAtEvent(at_end, trial);
    }
    if (hiddenEvent(system, context, trial, now)) {
      ++context.counts.rejected;
      return integrator.setStep(0.5 * trial.h);
    }
  }
  accept(t, trial);
  integrator.accept(system, context, trial, last, t_end);
  checkState();
}

// a step that failed: a shorter one next, or the end of the run
void Simulation::Run::refuse(const Trial& trial) {
  ++context.counts.rejected;
  if (integrator.goesExplicit(trial)) return;
  const bool finite = trial.finite();
  const double shorter = trial.h * Integrator::shrinkBy(trial);
  const double shortest = hasGround(system, now.edge) ? kShortestOnGround : kShortest;
  if (!system.fixed_step && shorter < shortest && finite && system.rigid && isFlat(now) &&
      !context.face.on && context.time >= context.chatter_until) {
    // the lowest point of a flat peg changes at once: step over that
    beginChatter(context.time, context);
  } else if (system.rigid && finite && shorter < kStepFloor && slips(context.slots)) {
    ++context.counts.events;
    if (noteEvent(system, now, context.time, context)) beginChatter(context.time, context);
    jam(system, false, context, now);
    decide(system, context, now);
    integrator.setStep(kAfterJam);
  } else if (system.fixed_step || shorter < kStepFloor) {
    context.stop = finite ? StopReason::kStepTooSmall : StopReason::kNonFinite;
  } else {
    integrator.refuse(system, context, trial, now);
  }
}

void Simulation::Run::accept(double t, const Trial& trial) {
  context.time = t;
  context.state = trial.end;
  context.slope = trial.slope;
  ++context.counts.steps;
  if (!system.admitted) return;
  if (trial.method == Method::kSlowSlip) followSlip(system, context, now);
  if (now.clear) {
    context.clearance -= now.moved;
    context.edge_speed = now.speed;
    return;
  }
  updateSlots(system, context, now);
  if (system.rigid) project(system, context, now);
  beginStep(system, context, now);
}

void Simulation::Run::endAtEvent(const Events& at_end, Trial& trial) {
  integrator.interrupt();
  locateEvent(system, context, at_end, trial, now);
  const double t = context.time + trial.h;
  if (noteEvent(system, now, t, context)) beginChatter(t, context);
  accept(t, trial);
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

// Before a slice of a carrier that gives way.
void Simulation::Run::followForce() {
  const Vec3 force =
      atPresent([](const Evaluation& e) -> Vec3 { return e.motion.FK + e.motion.FC; });
  giveWay(context.commands, system.scenario.imperfections.compliance, context.time,
          fromThesisAxes(force));
  context.stale = true;
  decideAfterCommand();
}

// of the present, after a command and before the run goes on
Evaluation Simulation::Run::afterCommand() const {
  Evaluation e = now;
  evaluate(system, context, context.time, context.state, Level::kEvents, e);
  e.closed_set = now.closed_set;
  e.open_set = now.open_set;
  return e;
}

Simulation::Simulation(const Scenario& scenario) : run_(std::make_unique<Run>(scenario)) {
  if (stopReason() == StopReason::kInitialOverlap) {
    throw InputError(
        "initial.peg.position: the peg's edge is more than 1e-8 m inside the block, which the "
        "rigid law refuses; raise it or set initial.close: true");
  }
}

Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

double Simulation::time() const { return run_->context.time; }
const State& Simulation::state() const { return run_->context.state; }
const Vector9& Simulation::acceleration() const { return run_->context.slope; }
const Scenario& Simulation::scenario() const { return run_->system.scenario; }
StopReason Simulation::stopReason() const { return run_->context.stop; }
RunCounts Simulation::counts() const {
  RunCounts counts = run_->context.counts;
  counts.evaluations = run_->now.count;
  return counts;
}

StopReason Simulation::advance(double t_end, std::int64_t attempts) {
  Context& c = run_->context;
  if (c.stop != StopReason::kOk) return c.stop;
  run_->decideAfterCommand();
  while (c.time < t_end && c.stop == StopReason::kOk && attempts-- > 0) {
    if (!run_->system.compliant) {
      run_->step(t_end);
      continue;
    }
    if (c.time >= c.commands.shift.updated + RestShift::kSlice - kSameTime) run_->followForce();
    const double update = c.commands.shift.updated + RestShift::kSlice;
    run_->step(update < t_end - kSameTime ? update : t_end);
  }
  return c.stop;
}

void Simulation::setRestTarget(const RestPose& target, double max_speed) {
  Context& c = run_->context;
  assembly_cell::setRestTarget(c.commands, scenario().mechanism, c.time, target, max_speed);
  c.stale = true;
}

void Simulation::followRest(const RestMotion& goal, double t_goal) {
  Context& c = run_->context;
  assembly_cell::followRest(c.commands, c.time, goal, t_goal);
  c.stale = true;
}

void Simulation::stopRest() {
  Context& c = run_->context;
  assembly_cell::stopRest(c.commands, scenario().mechanism, c.time);
  c.stale = true;
}

Vector6 Simulation::stopWay() const {
  return assembly_cell::stopWay(run_->context.commands, scenario().mechanism, time());
}

RestPose Simulation::rest() const {
  return restPose(run_->context.commands.restAt(time()).position);
}

void Simulation::setRestShift(const Vector6& shift) {
  Context& c = run_->context;
  assembly_cell::setRestShift(c.commands, scenario().mechanism, c.time, shift);
  c.stale = true;
}

Vector6 Simulation::restShift() const {
  const RestShift& shift = run_->context.commands.shift;
  return shift.any ? shift.at(time()) : Vector6::Zero();
}

bool Simulation::atRest() const { return run_->context.commands.settledAt(time()); }

void Simulation::setExciter(const ExciterParameters& exciter, double t_ref) {
  Drive& drive = run_->context.commands.drive;
  drive.exciter = exciter;
  drive.t_ref = t_ref;
  run_->context.stale = true;
  run_->now.drive_time = -1.0;
}

std::array<ContactReport, kSlots> Simulation::contacts() const {
  const System& s = run_->system;
  const SlotArray& slots = run_->context.slots;
  // all slots are searched and the internal force of two sticking contacts is shared
  Evaluation e = run_->context.stale ? run_->afterCommand() : run_->now;
  if (const ContactSlotMask others = s.admitted & ~e.closed) {
    locate(s, run_->context, others, e, e.open_set);
  }
  ContactSlotMask sticking = 0;
  for (const std::size_t i : Slots(e.active())) {
    if (slots[i].mode == Mode::kStick) sticking |= 1u << i;
  }
  if (__builtin_popcount(sticking) == 2) shareInternalForces(s, sticking, e.loads, e);
  std::array<ContactReport, kSlots> report;
  for (std::size_t i = 0; i < kSlots; ++i) {
    ContactReport& r = report[i];
    r.feature = static_cast<ContactReport::Feature>(
        e.material >> i & 1u ? ContactFeature::kEdgePlane : featureOfSlot(static_cast<int>(i)));
    r.valid = (s.admitted & e.valid()) >> i & 1u;
    if (!r.valid) continue;
    const ContactKinematics& at = e.contacts[i];
    const bool carries = slots[i].mode != Mode::kApart && at.normal_force > 0.0;
    const bool sticks = s.discrete_friction
                            ? slots[i].mode == Mode::kStick
                            : at.tangential.norm() <= s.scenario.contact.regularisation_speed;
    if (carries) {
      r.state = sticks ? ContactReport::kStick : ContactReport::kSlip;
      r.force = fromThesisAxes(at.force);
    }
    r.point = fromThesisAxes(e.point(i).p);
    r.normal = fromThesisAxes(e.point(i).normal);
    r.gap = e.point(i).gap;
  }
  return report;
}

Vector6 Simulation::couplingWrench() const {
  const FreeMotion motion = run_->atPresent([](const Evaluation& e) { return e.motion; });
  const Mat3 inverse_transposed = kinematics(state()).Re.transpose().inverse();
  const Vec3 force = motion.FK + motion.FC;
  const Vec3 moment =
      inverse_transposed * Vec3(motion.FKm(2), motion.FKm(1), motion.FKm(0)) + motion.FCm;
  // about the rest point, in the carrier's axes
  const Vec3 about_rest = moment + motion.deflection.head<3>().cross(force);
  const Mat3 R_CH = carrierPose().R.transpose();
  Vector6 w;
  w << R_CH * fromThesisAxes(force), R_CH * fromThesisAxes(about_rest);
  return w;
}

Vector6 Simulation::holeWrench() const {
  return run_->atPresent([](const Evaluation& e) {
    Vector6 w = Vector6::Zero();
    for (const std::size_t i : Slots(e.active())) {
      const Vec3 force = -fromThesisAxes(e.contacts[i].force);
      w.head<3>() += force;
      w.tail<3>() += fromThesisAxes(e.point(i).p).cross(force);
    }
    return w;
  });
}

Eigen::Vector2d Simulation::specificForce(double height) const {
  const Kinematics k = kinematics(state());
  const Vector9& rate = acceleration();
  const Vec3 turn = k.Re * rate.segment<3>(3) + k.Re_rate * state().v.segment<3>(3);
  const Vec3 arm = height * k.a;
  Vec3 felt = rate.head<3>() + turn.cross(arm) + k.omega.cross(k.omega.cross(arm));
  felt[0] += scenario().mechanism.gravity;  // thesis axis 1 is up
  // peg axes: x is the thesis's second, y against its first
  return {k.R1.dot(felt), -k.R0.dot(felt)};
}

Pose Simulation::pegPose() const {
  const Kinematics k = kinematics(state());
  Pose X;
  X.R.col(0) = fromThesisAxes(k.R1);
  X.R.col(1) = -fromThesisAxes(k.R0);
  X.R.col(2) = fromThesisAxes(k.a);
  X.p = fromThesisAxes(k.x - scenario().mechanism.peg.half_height * k.a);
  return X;
}

Pose Simulation::carrierPose() const {
  const Vector6 rest = run_->context.commands.restAt(time()).position;
  const Vector9& q = state().q;
  Pose X;
  X.R = rotationFromEuler({rest(5), rest(4), q(8)});
  X.p = Vec3(q(6), q(7), rest(2));
  return X;
}

RestPose Simulation::carrier() const {
  RestPose pose = rest();
  const Vector9& q = state().q;
  pose.x = q(6);
  pose.y = q(7);
  pose.yaw = q(8);
  return pose;
}

double Simulation::energy() const { return energyOf(run_->system, run_->context); }

}  // namespace assembly_cell
