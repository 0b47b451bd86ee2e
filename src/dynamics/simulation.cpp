// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/simulation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/scene/input_error.h"
#include "contact_algebra.h"
#include "limits.h"

namespace assembly_cell {
namespace {

constexpr double kEventTime = 1e-12;  // events are located to this [s]
constexpr double kTaylorTime =
    1e-9;  // a step is lengthened by less than this without a new one [s]
// as many events as are remembered within kCluster are a storm (a peg that lies flat, rocking): for
// kCoarseSpan the run goes on in steps of at most kCoarseStep without locating events [s]; under
// the rigid law so short that a point pressed on falls by less than kHop between two impacts [m]
constexpr double kCluster = 2e-4, kCoarseSpan = 2e-3, kCoarseStep = 2e-5, kLeastCoarse = 5e-7;
constexpr double kHop = 1e-10;
constexpr double kIdleDepth = 1e-12;  // an idle contact that goes on approaching is hit there [m]
constexpr double kLift = 1e-11;  // a contact lifted farther at an event pays for it with speed [m]
// the rigid law has storms only where the peg is flat [rad], or within this [s]: two places of
// contact that merge push each other open for ever
constexpr double kFlatTilt = 1e-3, kStandstill = 8e-6;
constexpr double kShortest = 2e-6;      // a rigid flat peg that asks for less is stepped over [s]
constexpr double kBlindPhase = 0.3;     // longer steps are looked at in their middle, too [rad]
constexpr double kShortestHalf = 1e-9;  // Hamming halves no further [s]
constexpr double kBridge = 1e-6;        // tried then [s]
constexpr double kStepFloor = 1e-13;    // error control below this step gives up [s]
constexpr std::int64_t kEventLimit = 10000000;
using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
EdgeCircle edgeOf(const Scenario& s, const Kinematics& k) {
  return {k.x - s.peg.half_height * k.a, k.R0, k.R1, s.peg.radius};
}

bool finite(const State& s) { return s.q.allFinite() && s.v.allFinite(); }

ContactSlotMask slotsOf(const ContactFeatures& features) {
  ContactSlotMask mask = 0;
  if (features.edge_edge) mask |= kEdgeEdgeSlots;
  if (features.edge_plane) mask |= kEdgePlaneSlots;
  if (features.edge_wall) mask |= kEdgeWallSlots;
  if (features.rim_side) mask |= kRimSideSlots;
  if (features.rim_face) mask |= kRimFaceSlots;
  return mask;
}

}  // namespace

const char* toString(StopReason reason) {
  switch (reason) {
    case StopReason::kOk:
      return "ok";
    case StopReason::kEdgeEdge:
      return "edge_edge";
    case StopReason::kEdgePlane:
      return "edge_plane";
    case StopReason::kEdgeWall:
      return "edge_wall";
    case StopReason::kRimSide:
      return "rim_side";
    case StopReason::kRimFace:
      return "rim_face";
    case StopReason::kPegTop:
      return "peg_top";
    case StopReason::kSingular:
      return "singular_orientation";
    case StopReason::kInitialOverlap:
      return "initial_overlap";
    case StopReason::kNonFinite:
      return "non_finite";
    case StopReason::kStepTooSmall:
      return "step_too_small";
    case StopReason::kEventLimit:
      return "event_limit";
  }
  return "unknown";
}

Simulation::Simulation(const Scenario& scenario) : scenario_(scenario) {
  const SolverParameters& solver = scenario_.solver;
  if (solver.integrator == "rk4") {
    method_ = Method::kRk4;
    fixed_step_ = true;
    if (!(solver.step > 0.0)) {
      throw InputError("solver.step: integrator rk4 needs a fixed step; set solver.step > 0 [s]");
    }
  } else if (solver.integrator == "hamming") {
    method_ = Method::kHamming;
    fixed_step_ = solver.step > 0.0;
  } else if (solver.integrator == "dop853") {
    method_ = Method::kDop853;
  } else if (solver.integrator != "dopri5") {
    throw InputError("solver.integrator: " + solver.integrator +
                     " is not available; use hamming, rk4, dopri5 or dop853");
  }
  if (scenario_.contact.law != ContactLaw::kNone) {
    // contacts that `features` excludes are watched as well: they end the run. The bottom face
    // never meets the rim before the edge meets the plane
    const ContactFeatures& features = scenario_.contact.features;
    const bool face = features.rim_face && !features.edge_plane;
    admitted_ = kAllContactSlots & ~(face ? 0u : kRimFaceSlots);
    excluded_ = admitted_ & ~slotsOf(features);
  }
  shapes_.hole_radius = scenario_.hole.radius;
  shapes_.hole_depth = scenario_.hole.depth;
  shapes_.peg_length = 2.0 * scenario_.peg.half_height;
  // slip is told from rest above the integrator's velocity error
  slip_threshold_ = std::max(1e-8, 1e4 * (fixed_step_ ? 1e-9 : solver.tolerance));
  // the thesis's rows let a stationary contact creep below v_ST
  if (scenario_.thesis.creep) {
    slip_threshold_ = std::max(slip_threshold_, scenario_.contact.regularisation_speed);
  }
  arm_ = std::hypot(scenario_.peg.half_height, scenario_.peg.radius);
  setProfile(restProfile(scenario_.rest));
  drive_.exciter = scenario_.exciter;

  const InitialState& s = scenario_.initial;
  State start;
  start.q.head<3>() = toThesisAxes(s.position);
  start.q.segment<3>(3) << s.euler.phi, s.euler.theta, s.euler.psi;
  start.q.tail<3>() << s.carrier_x, s.carrier_y, s.carrier_yaw;
  start.v.head<3>() = toThesisAxes(s.velocity);
  start.v.segment<3>(3) = s.euler_rates;
  start.v.tail<3>() = s.carrier_velocity;

  // lower the peg until the smallest gap is zero: gaps fall with the height
  if (s.close) {
    const auto smallest = [&](double z) {
      State at = start;
      at.q(0) = z;
      ContactSet set;
      findContacts(edgeOf(scenario_, kinematics(at)), shapes_, admitted_ & ~excluded_, set);
      double gap = 1.0;
      for (std::size_t i = 0; i < kSlots; ++i) {
        if (set.valid >> i & 1u) gap = std::min(gap, set.slots[i].gap);
      }
      return gap;
    };
    double high = start.q(0), low = high;
    const double span = scenario_.peg.half_height + scenario_.peg.radius;
    double step = 1e-4 * span;
    while (smallest(high) <= 0.0 && high < start.q(0) + 2 * span) high += step, step *= 1.5;
    step = 1e-4 * span;
    while (smallest(low) > 0.0 && low > start.q(0) - 4 * span) {
      high = low;
      low -= step;
      step = std::min(1.2 * step, 0.02 * span);
    }
    if (smallest(low) > 0.0 || smallest(high) <= 0.0) {
      throw InputError(
          "initial.close: true, but lowering the peg closes no contact of contact.features; "
          "move initial.peg.position over the block or set close: false");
    }
    for (int i = 0; i < 200 && high - low > 1e-17; ++i) {
      const double middle = 0.5 * (low + high);
      (smallest(middle) > 0.0 ? high : low) = middle;
    }
    start.q(0) = high;
  }
  setState(start);
  if (stop_ == StopReason::kInitialOverlap) {
    throw InputError(
        "initial.peg.position: the peg's edge is more than 1e-8 m inside the block, which the "
        "rigid law "
        "refuses; raise it or set initial.close: true");
  }
}

void Simulation::setProfile(const RestProfile& profile) {
  profile_ = profile;
  settled_ = restMotion(profile, profile.start + profile.duration);
}

void Simulation::setRestTarget(const RestPose& target) {
  const double arm = scenario_.peg.coupling_height + scenario_.peg.half_height;
  setProfile(planRest(restAt(time_), time_, target, scenario_.carrier, arm));
  stale_ = true;
}

void Simulation::setExciter(const ExciterParameters& exciter, double t_ref) {
  drive_.exciter = exciter;
  drive_.t_ref = t_ref;
  drive_time_ = -1.0;
  stale_ = true;
}

void Simulation::setState(const State& state) {
  state_ = state;
  stop_ = StopReason::kOk;
  next_step_ = scenario_.solver.max_step;
  slots_ = {};
  touches_ = {};
  closed_ = 0;
  closed_set_ = {};
  open_set_ = {};
  clearance_ = 0.0;
  history_.count = 0;
  recent_events_.fill(-1.0);
  coarse_until_ = -1.0;
  near_ = {};
  if (!finite(state_)) {
    stop_ = StopReason::kNonFinite;
    return;
  }
  if (std::sin(state_.q(4)) < 0.1) {
    stop_ = StopReason::kSingular;
    return;
  }
  findModes(true);
}

// The event functions of the slots: gap, normal force, friction; and what slipping points are from
// a wedge. Below zero a mode must change.
Simulation::Events Simulation::eventValues() const {
  Events events;
  events.fill(HUGE_VAL);
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(admitted_ >> i & 1u)) continue;
    double* const value = &events[kEventKinds * i];
    const Slot& slot = slots_[i];
    const Touch& touch = touches_[i];
    if (slot.mode == Mode::kApart) {
      if (!valid(i)) continue;
      // a rigid contact that is just leaving may still be at its rounding
      const bool leaving = rigid() && touch.gap > -kReach && touch.gap_rate > 0.0;
      if (!leaving) value[0] = touch.gap + kTouch;
      continue;
    }
    if (!valid(i)) {
      value[0] = -1.0;
      continue;
    }
    if (slot.mode == Mode::kIdle) {
      // an idle slot out of reach asks for nothing any more
      if (touch.gap < leaveGap()) value[1] = touch.demand + approach_;
      if (rigid() && touch.gap_rate < -kSettledSpeed) value[0] = touch.gap + kIdleDepth;
      continue;
    }
    value[0] = leaveGap() - touch.gap;
    if (!discreteFriction()) {
      // the branch that friction has been on, a rounding beyond its end
      const double limit = scenario_.contact.regularisation_speed;
      const double beyond = touch.tangential.norm() - limit;
      if (!scenario_.thesis.sign_flip) value[1] = touch.normal_force + pull_;
      value[2] = 1e-9 * limit + (slot.armed ? beyond : -beyond);
      continue;
    }
    value[1] = touch.normal_force + pull_;
    if (slot.mode == Mode::kStick) {
      value[2] = pull_ - coneExcess(i);
    } else if (slot.armed) {
      value[2] = touch.tangential.dot(slot.slip_start) - slip_threshold_;
    } else {
      value[2] = slipAhead(i);
    }
  }
  events.back() = wedge_margin_ - kWedged;
  return events;
}

// Position, velocity and acceleration at both ends make one polynomial of order six for all
// integrators; short steps, where it would cancel, take velocities from their own cubic.
State Simulation::interpolate(double h, const State& end, const Vector9& slope, double tau) const {
  const double u = tau / h;
  const Vector9 v0 = h * state_.v, v1 = h * end.v, a0 = h * h * slope_v_, a1 = h * h * slope;
  const Vector9 d = end.q - state_.q;
  const Vector9 c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
  const Vector9 c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
  const Vector9 c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
  State s;
  s.q = state_.q + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
  if (h > 1e-6) {
    s.v = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
  } else {
    const Vector9 dv = end.v - state_.v, s0 = h * slope_v_, s1 = h * slope;
    s.v = state_.v + u * (s0 + u * (3.0 * dv - 2.0 * s0 - s1 + u * (-2.0 * dv + s0 + s1)));
  }
  return s;
}

// The first change within a step that ends with one: bracketed on the interpolant (Illinois with
// bisection against jumps), then the step is taken anew to exactly there and corrected if the event
// functions are off. Returns the step; `end` and `slope` are those of the event.
double Simulation::locateEvent(double h, const Events& at_end, State& end, Vector9& slope) {
  const State whole_end = end;
  const Vector9 whole_slope = slope;
  // the interpolant is not worth more
  const double resolution = std::max({0.1 * kEventTime, 4e-16 * std::abs(time_), 1e-7 * h});
  // of those that are broken at the end, each against its value there
  const auto first = [&](const Events& events) {
    double value = 1e3;
    for (std::size_t i = 0; i < events.size(); ++i) {
      if (at_end[i] < 0.0) value = std::min(value, events[i] / -at_end[i]);
    }
    return value;
  };
  const auto valueAt = [&](double tau) {
    const State s = interpolate(h, whole_end, whole_slope, tau);
    if (!finite(s)) return -1.0;
    evaluate(time_ + tau, s, Look::kEvents);
    return first(eventValues());
  };
  double low = 0.0, high = h, f_low = std::max(first(start_events_), 1e-300), f_high = -1.0;
  int side = 0;
  for (int i = 0; i < 200 && high - low > resolution; ++i) {
    double middle =
        i % 4 == 3 ? 0.5 * (low + high) : (low * f_high - high * f_low) / (f_high - f_low);
    middle = std::clamp(middle, low + 0.25 * resolution, high - 0.25 * resolution);
    const double f = valueAt(middle);
    if (f < 0.0) {
      high = middle;
      f_high = f;
      if (side == -1) f_low *= 0.5;
      side = -1;
    } else {
      low = middle;
      f_low = std::max(f, 1e-300);
      if (side == 1) f_high *= 0.5;
      side = 1;
    }
  }

  // exactly there; slope of the event function for the correction
  const double span = std::min(1e-6, 0.5 * high);
  const double rate = (valueAt(high) - valueAt(high - span)) / span;
  double tau = high;
  const Method method = method_ == Method::kHamming ? Method::kRk4 : method_;
  for (int i = 0; i < 3; ++i) {
    tryOneStep(method, tau, end, slope);
    const double f = first(eventValues());
    const double off = rate < 0.0 && std::isfinite(f) ? -f / rate : 0.0;
    if (std::abs(off) < 0.5 * kEventTime || std::abs(off) > 0.1 * h || i == 2) break;
    tau += std::clamp(off, -0.5 * tau, h - tau);
    if (std::abs(off) < kTaylorTime) {
      // so near that the slopes at hand are exact
      end.q += off * (end.v + 0.5 * off * slope);
      end.v += off * slope;
      slope = evaluate(time_ + tau, end, Look::kEvents);
      break;
    }
  }
  return tau;
}

// a mode broken in the middle of a step that ends with none: resting contacts are shaken loose and
// caught within part of a turn of the exciter. The last evaluation stays that of the end.
bool Simulation::hiddenEvent(double h, const State& end, const Vector9& slope) {
  if (fixed_step_ || !discreteFriction() || !closed_ ||
      h * drive_.exciter.frequency < kBlindPhase) {
    return false;
  }
  const std::array<Touch, kSlots> touches = touches_;
  const ContactSet closed = closed_set_, open = open_set_;
  const Now now = now_;
  const double margin = wedge_margin_;
  evaluate(time_ + 0.5 * h, interpolate(h, end, slope, 0.5 * h), Look::kEvents);
  bool broken = false;
  for (const double value : eventValues()) broken = broken || value < 0.0;
  touches_ = touches;
  closed_set_ = closed;
  open_set_ = open;
  now_ = now;
  wedge_margin_ = margin;
  return broken;
}

// what the next step's events are told by
void Simulation::startStep() {
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u) || !slots_[i].armed) continue;
    const double speed = touches_[i].tangential.norm();
    if (speed > 0.0) slots_[i].slip_start = touches_[i].tangential / speed;
  }
  start_speed_ = edgeSpeed();
  clearance_ = contactClearance(now_.edge, shapes_);
  start_events_ = eventValues();
}

void Simulation::accept(double t, const State& end, const Vector9& slope) {
  time_ = t;
  state_ = end;
  slope_v_ = slope;
  ++counts_.steps;
  if (!admitted_) return;
  if (clear_) {
    clearance_ -= moved_;
    start_speed_ = speed_;
    return;
  }
  healDepths();
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u)) continue;
    Slot& slot = slots_[i];
    if (slot.mode == Mode::kSlip && discreteFriction() &&
        touches_[i].tangential.norm() > 2.0 * slip_threshold_) {
      slot.armed = true;
    }
    if (slot.mode == Mode::kIdle && valid(i) && touches_[i].gap >= leaveGap())
      setMode(i, Mode::kApart);
  }
  if (rigid()) project();
  startStep();
}

// at an event: slots that have closed or left are told so, decide() does the rest
void Simulation::changeModes() {
  const double before = rigid() ? energy() : 0.0;
  bool closed = false, lost = false;
  double handed = 0.0;  // gap of a contact that was lost
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u)) continue;
    if (!valid(i) || touches_[i].gap >= leaveGap()) {
      lost = lost || !valid(i);
      if (!valid(i) && !rigid()) handed = std::min(handed, touches_[i].gap);
      setMode(i, Mode::kApart);
    } else if (rigid() && slots_[i].mode == Mode::kIdle && touches_[i].gap < 0.0) {
      closed = closed || touches_[i].gap_rate < -kSettledSpeed;
    }
  }
  // a contact that is handed over to the next feature finds it at gap zero
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(admitted_ >> i & 1u) || (closed_ >> i & 1u) || !valid(i)) continue;
    const double gap = touches_[i].gap, rate = touches_[i].gap_rate;
    const bool closes = gap < 0.0 && !(rigid() && gap > -kReach && rate > 0.0);
    const bool at_event = gap <= 2.0 * kEventTime * std::abs(rate) && rate < 0.0;
    if (!closes && !at_event && !(lost && gap < kReach)) continue;
    setMode(i, discreteFriction() ? Mode::kIdle : Mode::kSlip);
    slots_[i].armed = false;
    if (scenario_.contact.law != ContactLaw::kViscous) keepDepth(i, handed);
    if (rate < -1e-9) {
      ++counts_.impacts;
      closed = true;
    }
  }
  if (closed && rigid()) impact();
  decide();
  if (rigid() && closed_ && energy() > before + kLift * freeAcceleration() * scenario_.peg.mass) {
    limitEnergy(before);
    decide();
  }
}

bool Simulation::slips() const {
  for (const Slot& slot : slots_) {
    if (slot.mode == Mode::kSlip && slot.armed) return true;
  }
  return false;
}

bool Simulation::flat() const { return std::hypot(now_.k.a(1), now_.k.a(2)) < kFlatTilt; }

// events so dense that they are not worth locating: the peg lies flat and rocks
bool Simulation::storm(double t) {
  double& oldest = recent_events_[static_cast<std::size_t>(counts_.events) % kRecentEvents];
  const double span = t - oldest;
  oldest = t;
  if (span >= kCluster) return false;
  return !rigid() || flat() || span < kStandstill;
}

// forces after a command, before the run goes on; leaves no trace in it
void Simulation::refresh() {
  if (!stale_) return;
  const ContactSet closed = closed_set_, open = open_set_;
  evaluate(time_, state_, Look::kEvents);
  closed_set_ = closed;
  open_set_ = open;
}

// what ends a run after a step
void Simulation::checkState() {
  if (std::sin(state_.q(4)) < 0.1) {
    stop_ = StopReason::kSingular;
  } else if (admitted_) {
    stop_ = excludedContact();
  }
}

// a contact that `features` excludes ends the run
StopReason Simulation::excludedContact() const {
  if (admitted_ && (closed_set_.top_reached || open_set_.top_reached)) return StopReason::kPegTop;
  const ContactSlotMask found = closed_ & excluded_;
  if (!found) return StopReason::kOk;
  switch (featureOfSlot(__builtin_ctz(found))) {
    case ContactFeature::kEdgeEdge:
      return StopReason::kEdgeEdge;
    case ContactFeature::kEdgePlane:
      return StopReason::kEdgePlane;
    case ContactFeature::kEdgeWall:
      return StopReason::kEdgeWall;
    case ContactFeature::kRimSide:
      return StopReason::kRimSide;
    case ContactFeature::kRimFace:
      break;
  }
  return StopReason::kRimFace;
}

// bound of the peg's acceleration without contacts, at its edge
double Simulation::freeAcceleration() const {
  return now_.free.head<3>().norm() + arm_ * now_.free.segment<3>(3).norm();
}

double Simulation::coarseStep() const {
  return std::clamp(std::sqrt(8.0 * kHop / freeAcceleration()), kLeastCoarse, kCoarseStep);
}

// the next step to take; true in `last` where it ends at t_end
double Simulation::planStep(double t_end, bool& last) const {
  const double left = t_end - time_;
  double h = fixed_step_ ? scenario_.solver.step : std::min(next_step_, scenario_.solver.max_step);
  if (time_ < coarse_until_) h = rigid() ? coarseStep() : std::min(h, kCoarseStep);
  if (method_ == Method::kHamming && !bridging_ && left > h) {
    // equal steps to the end, so that the past stays of use
    const bool same = history_.count > 0 && history_.h <= h * (1 + 1e-6);
    const double wanted = same ? history_.h : h;
    h = left / std::max(1.0, std::ceil(left / wanted - 1e-6));
  }
  const double resolution = 4e-16 * std::max(1.0, std::abs(t_end));
  last = time_ + h >= t_end - resolution;
  return last ? left : h;
}

// a step that failed: false when there is no shorter one worth trying
bool Simulation::shorten(double h, double error, bool is_finite) {
  ++counts_.rejected;
  const double order = method_ == Method::kDop853 ? 8.0 : 5.0;
  const double factor =
      std::isfinite(error) && is_finite ? std::max(0.2, 0.9 * std::pow(error, -1.0 / order)) : 0.1;
  // the lowest point of a flat peg changes at once: step over that
  if (!fixed_step_ && h * factor < kShortest && is_finite && rigid() && flat() &&
      time_ >= coarse_until_) {
    coarse_until_ = time_ + kCoarseSpan;
    return true;
  }
  if (rigid() && is_finite && h * factor < kStepFloor && slips()) {
    ++counts_.events;
    if (storm(time_)) coarse_until_ = time_ + kCoarseSpan;
    jam();
    decide();
    next_step_ = kBridge;
    return true;
  }
  if (fixed_step_ || h * factor < kStepFloor) {
    stop_ = is_finite ? StopReason::kStepTooSmall : StopReason::kNonFinite;
    return false;
  }
  next_step_ = h * factor;
  if (method_ == Method::kHamming && !bridging_) {
    if (h < kShortestHalf) {
      // halving finds no smooth past here: one step of dopri5, then a new start
      bridging_ = true;
      history_.count = 0;
      next_step_ = kBridge;
      return true;
    }
    next_step_ = 0.5 * h;
    if (history_.count >= 4) {
      halveHistory();
    } else {
      history_.count = 0;
    }
  }
  return true;
}

// the step after one that was accepted
void Simulation::lengthen(double h, double error, bool last, double t_end) {
  if (fixed_step_) return;
  if (method_ == Method::kHamming) {
    // HPCG: twice the step below a fiftieth of the tolerance, at an even number of steps to go
    const double steps = std::round((t_end - time_) / h);
    if (history_.count == History::kMost && error < 0.02 && std::fmod(steps, 2.0) == 0.0 &&
        2.0 * h <= scenario_.solver.max_step * (1 + 1e-9)) {
      doubleHistory();
      next_step_ = 2.0 * h;
    }
    return;
  }
  if (last && error <= 0.5) return;
  const double order = method_ == Method::kDop853 ? 8.0 : 5.0;
  next_step_ = h * std::clamp(0.9 * std::pow(std::max(error, 1e-10), -1.0 / order), 0.2, 5.0);
}

StopReason Simulation::advance(double t_end, std::int64_t attempts) {
  if (stop_ != StopReason::kOk) return stop_;
  // forces jump with the commands: decide anew who slips
  if (stale_ && !(rigid() && time_ < coarse_until_)) decide();
  State end;
  Vector9 slope;
  while (time_ < t_end && stop_ == StopReason::kOk && attempts-- > 0) {
    bool last = false;
    const bool coarse = time_ < coarse_until_;
    double h = planStep(t_end, last);
    if (coarse && rigid()) {
      stormStep(last ? t_end : time_ + h);
      checkState();
      continue;
    }
    const double attempt =
        bridging_ ? tryOneStep(Method::kDopri5, h, end, slope) : tryStep(h, end, slope);
    const bool is_finite = finite(end) && slope.allFinite();
    if (!is_finite || !(attempt <= 1.0)) {
      if (!shorten(h, attempt, is_finite)) return stop_;
      continue;
    }

    Events events;
    bool quiet = true;
    if (admitted_ && !coarse && !clear_) {
      events = eventValues();
      for (const double value : events) quiet = quiet && value >= 0.0;
      if (quiet && hiddenEvent(h, end, slope)) {
        ++counts_.rejected;
        next_step_ = 0.5 * h;
        continue;
      }
    }
    if (coarse) {
      // amid a storm: modes decided after each step, nothing located
      accept(last ? t_end : time_ + h, end, slope);
      lengthen(h, attempt, last, t_end);
      findModes(false);
    } else if (quiet) {
      accept(last ? t_end : time_ + h, end, slope);
      if (bridging_) {
        bridging_ = false;
        next_step_ = std::max(next_step_, kBridge);
      } else {
        if (method_ == Method::kHamming) remember(h);
        lengthen(h, attempt, last, t_end);
      }
    } else {
      bridging_ = false;
      h = locateEvent(h, events, end, slope);
      if (storm(time_ + h)) {
        // a tenth of both where no flat peg is the cause: modes decided late cost energy
        coarse_until_ = time_ + h + kCoarseSpan;
      }
      accept(time_ + h, end, slope);
      ++counts_.events;
      changeModes();
      if (counts_.events > kEventLimit) {
        stop_ = StopReason::kEventLimit;
        return stop_;
      }
    }
    checkState();
  }
  return stop_;
}

const std::array<ContactReport, kSlots>& Simulation::contacts() {
  // looking leaves no trace: all slots are searched and the internal force of two resting points is
  // shared, then what the run has is put back
  const std::array<Touch, kSlots> touches = touches_;
  const ContactSet open = open_set_;
  refresh();
  if (const ContactSlotMask others = admitted_ & ~closed_) locate(others, open_set_);
  ContactSlotMask resting = 0;
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u) || !valid(i) || slots_[i].mode != Mode::kStick) continue;
    resting |= 1u << i;
  }
  if (__builtin_popcount(resting) == 2) shareInternalForces(resting, kLoads);
  for (std::size_t i = 0; i < kSlots; ++i) {
    const Slot& slot = slots_[i];
    const Touch& touch = touches_[i];
    ContactReport& r = report_[i];
    r.feature = static_cast<ContactReport::Feature>(featureOfSlot(static_cast<int>(i)));
    r.valid = (admitted_ >> i & 1u) && valid(i);
    const bool carries = r.valid && slot.mode != Mode::kApart && touch.normal_force > 0.0;
    const bool rests = discreteFriction()
                           ? slot.mode == Mode::kStick
                           : touch.tangential.norm() <= scenario_.contact.regularisation_speed;
    r.state = !carries ? ContactReport::kOpen
              : rests  ? ContactReport::kStick
                       : ContactReport::kSlip;
    if (!r.valid) {
      r.force.setZero();
      r.gap = 0.0;
      continue;
    }
    r.point = fromThesisAxes(point(i).p);
    r.normal = fromThesisAxes(point(i).normal);
    r.force = carries ? fromThesisAxes(touch.force) : Vec3(Vec3::Zero());
    r.gap = point(i).gap;
  }
  touches_ = touches;
  open_set_ = open;
  return report_;
}

Vector6 Simulation::couplingWrench() {
  refresh();
  const Kinematics k = kinematics(state_);
  Mat3 inverse_transposed = k.Re.transpose().inverse();
  const Vec3 force = now_.motion.FK + now_.motion.FC;
  const Vec3 moment =
      inverse_transposed * Vec3(now_.motion.FKm(2), now_.motion.FKm(1), now_.motion.FKm(0)) +
      now_.motion.FCm;
  // about the rest point, in the carrier's axes
  const Vec3 about_rest = moment + now_.motion.deflection.head<3>().cross(force);
  const Mat3 R_CH = carrierPose().R.transpose();
  Vector6 w;
  w << R_CH * fromThesisAxes(force), R_CH * fromThesisAxes(about_rest);
  return w;
}

Vector6 Simulation::couplingDeflection() {
  refresh();
  const Mat3 R_CH = carrierPose().R.transpose();
  Vector6 d;
  d << R_CH * fromThesisAxes(now_.motion.deflection.head<3>()),
      vectorFromRotation(R_CH * pegPose().R).value;
  return d;
}

Vector6 Simulation::holeWrench() {
  refresh();
  Vector6 w = Vector6::Zero();
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u) || !valid(i)) continue;
    const Vec3 force = -fromThesisAxes(touches_[i].force);
    w.head<3>() += force;
    w.tail<3>() += fromThesisAxes(point(i).p).cross(force);
  }
  return w;
}

Pose Simulation::pegPose() const {
  const Kinematics k = kinematics(state_);
  Pose X;
  X.R.col(0) = fromThesisAxes(k.R1);
  X.R.col(1) = -fromThesisAxes(k.R0);
  X.R.col(2) = fromThesisAxes(k.a);
  X.p = fromThesisAxes(k.x - scenario_.peg.half_height * k.a);
  return X;
}

Pose Simulation::carrierPose() const {
  const Vector6 rest = restAt(time_).position;
  Pose X;
  X.R = rotationFromEuler({rest(5), rest(4), state_.q(8)});
  X.p = Vec3(state_.q(6), state_.q(7), rest(2));
  return X;
}

double Simulation::energy() const { return mechanicalEnergy(scenario_, state_, restAt(time_)); }

}  // namespace assembly_cell
