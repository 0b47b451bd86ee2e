// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "event_locator.h"

#include <algorithm>
#include <cmath>

#include "contact/contact_modes.h"
#include "contact/contact_solver.h"
#include "contact/contact_tolerances.h"
#include "contact/slow_slip.h"
#include "face/face.h"

namespace assembly_cell {
namespace {

// Maximum correction of a step's end by its Taylor series instead of a repeated step; the third
// order term is 1e-27 s³. Half and twice: 61 and 58 of 400 random scenes, those with many impacts,
// end elsewhere, effort −3 % and −1 %.
constexpr double kTaylorTime = 1e-9;  // [s]
// Penetration at which an approaching idle contact is an event, above kTouch: 3 of 400 scenes, by
// 0.1 um.
constexpr double kIdleDepth = 1e-12;  // [m]
// Negative value of an event function at the located event, over that at the step's end, above
// which the function is discontinuous: a contact point has vanished. No result changes at half or
// twice.
constexpr double kJump = 1e-3;
// Phase of the exciter [rad] per sample of the event functions within a step, as a contact may open
// and close within it. Half: no result changes; twice: one jammed run of six does.
constexpr double kSamplePhase = 0.3;  // [rad]
// Rotation of friction in a step above which it is sampled, too, as slip may end and begin again;
// not for steps of slow_slip.h, which detect that.
constexpr double kSampleSlip = 1.0;
constexpr int kMaxSamples = 8;
// Number of samples replaced by the event functions at the stages at 0.3 and 0.8 of a step of
// dopri5, if these are far from zero: in 200 vibrated runs no event was missed.
constexpr int kStageSamples = 2;
// Number of polynomial steps of the root search before bisection alternates. One less and one more:
// the same events, within 0.2 % of their evaluations.
constexpr int kPolynomials = 3;
// Length of a step below which it is repeated instead of interpolated, by rounding [s].
constexpr double kRefined = 1e-6;
// Change of the interpolant by refine() over the tolerance above which the step is repeated. No
// result of the suite changes at half or twice of either; without it a rocking face is off by 3.6
// tolerances.
constexpr double kDense = 1.0;

// Component of slip along that at the step's start [m/s]; of a face its maximum over the points.
double onwards(const Context& c, const Evaluation& e, std::size_t i) {
  double fastest = e.contacts[i].tangential.dot(c.slots[i].slip_start);
  if (!(e.face >> i & 1u)) return fastest;
  for (const std::size_t j : Slots(e.active() & e.face)) {
    if (!c.slots[j].armed || c.slots[j].mode != Mode::kSlip) continue;
    fastest = std::max(fastest, e.contacts[j].tangential.dot(c.slots[j].slip_start));
  }
  return fastest;
}

// Event functions of a closed contact: gap, normal force, friction.
void slotEvents(const System& s, const Context& c, const Evaluation& e, std::size_t i,
                double* value) {
  const Slot& slot = c.slots[i];
  const ContactKinematics& at = e.contacts[i];
  if (slot.mode == Mode::kIdle) {
    if (s.rigid) {
      // out of reach it has no demand
      if (at.gap < s.leave_gap) value[1] = at.demand + c.approach;
      if (at.gap_rate < -kSettledSpeed) value[0] = at.gap + kIdleDepth;
    } else {
      // a demand before it is out of reach is found from a step's end beyond, too
      value[0] = s.leave_gap - at.gap;
      value[1] = at.demand + c.approach;
    }
    return;
  }
  value[0] = s.leave_gap - at.gap;
  if (!s.discrete_friction) {
    // the present branch of friction, with a margin for rounding
    const double limit = s.scenario.contact.regularisation_speed;
    const double beyond = at.tangential.norm() - limit;
    if (!s.scenario.thesis.sign_flip) value[1] = at.normal_force + c.pull;
    value[2] = 1e-9 * limit + (slot.armed ? beyond : -beyond);
    return;
  }
  value[1] = at.normal_force + c.pull;
  if (slot.mode == Mode::kStick) {
    value[2] = c.pull - coneExcess(s, e, i);
  } else if (slot.armed) {
    value[2] = onwards(c, e, i) - slipThreshold(s, e);
  } else {
    value[2] = slipAhead(s, slot, i, e);
  }
}

auto broken(const Events& events) {
  return std::count_if(events.begin(), events.end(), [](double value) { return value < 0.0; });
}

// First of the event functions below zero at the step's end, by the ratio to its value there.
struct First {
  double value = 1e3;
  std::size_t event = 0;
};
First firstOf(const Events& events, const Events& at_end) {
  First first;
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (at_end[i] < 0.0 && events[i] / -at_end[i] < first.value) {
      first = {events[i] / -at_end[i], i};
    }
  }
  return first;
}

}  // namespace

Events eventValues(const System& s, const Context& c, const Evaluation& e) {
  Events events(s.slots);
  for (const std::size_t i : Slots(s.admitted)) {
    double* const value = events.ofSlot(i);
    const ContactKinematics& at = e.contacts[i];
    if (c.slots[i].mode == Mode::kApart) {
      if (c.slots[i].rises && e.valid(i)) value[1] = at.gap_rate;
      // a rigid contact that is opening may still have a gap of rounding size
      const bool leaving = s.rigid && at.gap > -kReach && at.gap_rate > 0.0;
      if (e.valid(i) && !leaving) value[0] = at.gap + kTouch;
    } else if (!e.valid(i)) {
      value[0] = -1.0;
    } else {
      slotEvents(s, c, e, i, value);
    }
  }
  events.wedge() = e.wedge_margin - kWedged;
  events.face() = faceEvent(s, c, e);
  return events;
}

void beginStep(const System& s, Context& c, const Evaluation& e) {
  for (const std::size_t i : Slots(s.admitted)) {
    Slot& slot = c.slots[i];
    slot.gap = slot.mode == Mode::kApart && e.valid(i) ? e.contacts[i].gap : HUGE_VAL;
    slot.gap_rate = e.contacts[i].gap_rate;
    slot.rises =
        slot.depth < 0.0 && slot.mode == Mode::kApart && e.valid(i) && e.contacts[i].gap_rate > 0.0;
  }
  for (const std::size_t i : Slots(e.closed)) {
    if (!c.slots[i].armed) continue;
    const double speed = e.contacts[i].tangential.norm();
    if (speed > 0.0) c.slots[i].slip_start = e.contacts[i].tangential / speed;
  }
  beginFaceStep(c, e);
  c.slip_turning = slipTurning(s, c, e);
  c.slip_falling = slipFalling(s, c, e);
  c.edge_speed = edgeSpeed(s, e.k);
  c.clearance = contactClearance(e.edge, s.shapes);
  c.events = eventValues(s, c, e);
}

namespace {

// Time within the step at which the cubic of an open gap has a negative minimum, for a gap that
// decreases at its start and increases at its end [s]; 0 if there is none.
double dipOfOpen(const Context& c, const Trial& step, const Evaluation& e) {
  for (const std::size_t i : Slots(e.open_set.valid & ~e.closed)) {
    const Slot& slot = c.slots[i];
    const double v0 = step.h * slot.gap_rate, v1 = step.h * e.contacts[i].gap_rate;
    if (slot.mode != Mode::kApart || !(slot.gap < HUGE_VAL && v0 < 0.0 && v1 > 0.0)) continue;
    const double d = e.contacts[i].gap - slot.gap;
    const double c2 = 3.0 * d - 2.0 * v0 - v1, c3 = v0 + v1 - 2.0 * d;
    // zero of the rate; c3 = 0 for a parabola
    const double root = std::sqrt(std::max(0.0, c2 * c2 - 3.0 * c3 * v0));
    const double u = -v0 / (c2 + root);
    if (u > 0.0 && u < 1.0 && slot.gap + u * (v0 + u * (c2 + u * c3)) < -kTouch) return u * step.h;
  }
  return 0.0;
}

// Time of the most negative minimum of the cubics of the closed slots' event functions, through
// their values at both ends and the stages [s]; 0 if there is none.
double dipOfClosed(const Context& c, const Trial& step, const Events& at_end,
                   ContactSlotMask closed) {
  double minimum = 0.0, at = 0.0;
  for (const std::size_t i : Slots(closed & ~step.stages.shared)) {
    for (std::size_t kind = 0; kind < kEventKinds; ++kind) {
      const double f0 = c.events.ofSlot(i)[kind], f1 = step.stages.value[0][i][kind];
      const double f2 = step.stages.value[1][i][kind], f3 = at_end.ofSlot(i)[kind];
      if (!(std::max({f0, f1, f2, f3}) < HUGE_VAL)) continue;
      // divided differences, and coefficients of powers of the fraction of the step
      const double d01 = (f1 - f0) / 0.3, d12 = (f2 - f1) / 0.5, d23 = (f3 - f2) / 0.2;
      const double d012 = (d12 - d01) / 0.8, c3 = (d23 - d12) / 0.7 - d012;
      const double c1 = d01 - 0.3 * d012 + 0.24 * c3, c2 = d012 - 1.1 * c3;
      const double square = c2 * c2 - 3.0 * c3 * c1;
      if (!(c1 < 0.0 && square > 0.0)) continue;
      const double u = -c1 / (c2 + std::sqrt(square));
      const double value = f0 + u * (c1 + u * (c2 + u * c3));
      if (!(u > 0.0 && u < 1.0 && value < minimum)) continue;
      minimum = value;
      at = u * step.h;
    }
  }
  return at;
}

// Exciter or friction rotate so far within the step that an event may be missed.
bool needsSamples(const Context& c, const Trial& step) {
  const bool turns = step.method != Method::kSlowSlip && step.h * c.slip_turning > kSampleSlip;
  return turns || step.h * c.commands.drive.exciter.frequency >= kSamplePhase;
}

// The event functions of all closed slots are far from zero at the stages.
bool staysInside(const StageEvents& stages, ContactSlotMask closed) {
  if (!stages.complete) return false;
  for (const auto& stage : stages.value) {
    for (const std::size_t i : Slots(closed)) {
      if (*std::min_element(stage[i].begin(), stage[i].end()) < 0.0) return false;
    }
  }
  return true;
}

}  // namespace

void recordStage(const System& s, const Context& c, const Evaluation& e, int stage,
                 StageEvents& stages) {
  ContactSlotMask sticking = 0;
  for (const std::size_t i : Slots(e.closed)) {
    if (c.slots[i].mode == Mode::kStick) sticking |= 1u << i;
  }
  stages.shared = sticking & (sticking - 1) ? sticking : 0;
  for (const std::size_t i : Slots(e.closed)) {
    auto& value = stages.value[stage][i];
    value.fill(HUGE_VAL);
    if (e.valid(i) && c.slots[i].mode != Mode::kIdle) {
      slotEvents(s, c, e, i, value.data());
    } else {
      stages.complete = false;
    }
  }
}

double hiddenEvent(const System& s, const Context& c, const Trial& step, const Events& at_end,
                   Evaluation& e, Evaluation& inside) {
  if (s.fixed_step) return 0.0;
  const double phase = step.h * c.commands.drive.exciter.frequency;
  const int sampling = std::clamp(static_cast<int>(phase / kSamplePhase), 1, kMaxSamples);
  const double dips[] = {dipOfOpen(c, step, e),
                         step.stages.recorded ? dipOfClosed(c, step, at_end, e.closed) : 0.0};
  const bool samples = sampling <= kStageSamples && staysInside(step.stages, e.closed);
  const bool blind = e.closed && !samples && needsSamples(c, step);
  if (dips[0] == 0.0 && dips[1] == 0.0 && !blind) return 0.0;
  inside = e;
  // nearer to the step's start a dip is rounding: the step would end there again and again
  const auto broken_at = [&](double tau) {
    if (tau <= kEventTime) return false;
    evaluate(s, c, c.time + tau, interpolate(c, step, tau), Level::kEvents, inside);
    e.count = inside.count;
    return broken(eventValues(s, c, inside)) > 0;
  };
  for (const double tau : dips) {
    if (broken_at(tau)) return tau;
  }
  for (int i = 1; blind && i <= sampling; ++i) {
    const double tau = step.h * i / (sampling + 1);
    if (broken_at(tau)) return tau;
  }
  return 0.0;
}

namespace {

// An event function of an open slot is below zero.
bool closes(const System& s, const Evaluation& e, const Events& events) {
  for (const std::size_t i : Slots(s.admitted & ~e.closed)) {
    const double* const value = events.ofSlot(i);
    if (*std::min_element(value, value + kEventKinds) < 0.0) return true;
  }
  return false;
}

// Values of the event functions at the last sampled times.
class SampledEvents {
 public:
  void add(double at, const Events& events) {
    newest_ = (newest_ + 1) % kCapacity;
    at_[newest_] = at;
    events_[newest_] = events;
    size_ = std::min(size_ + 1, kCapacity);
  }

  // Zero of the interpolation polynomial of one event function, by Newton's method from the zero of
  // the line through the last two values; HUGE_VAL if there is none.
  double root(std::size_t event) const {
    std::array<double, kCapacity> at, part;  // divided differences
    std::size_t n = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const std::size_t k = (newest_ + kCapacity - i) % kCapacity;
      if (!(events_[k][event] < HUGE_VAL)) continue;
      at[n] = at_[k];
      part[n++] = events_[k][event];
    }
    if (n < 2) return HUGE_VAL;
    for (std::size_t order = 1; order < n; ++order) {
      for (std::size_t i = n - 1; i >= order; --i) {
        part[i] = (part[i] - part[i - 1]) / (at[i] - at[i - order]);
      }
    }
    double zero = at[0] - part[0] / part[1];
    for (int i = 0; i < kNewton && n > 2; ++i) {
      double value = part[n - 1], slope = 0.0;
      for (std::size_t k = n - 1; k-- > 0;) {
        slope = value + (zero - at[k]) * slope;
        value = part[k] + (zero - at[k]) * value;
      }
      zero -= value / slope;
    }
    return zero;
  }

 private:
  static constexpr std::size_t kCapacity = 4;
  static constexpr int kNewton = 4;
  std::array<double, kCapacity> at_{};
  std::array<Events, kCapacity> events_;
  std::size_t newest_ = 0, size_ = 0;
};

// Search for the first event within a trial step.
struct EventSearch {
  const System& s;
  const Context& c;
  Trial whole;    // trial step
  Events at_end;  // at its end; those below zero are searched
  Trial& step;
  Evaluation& e;
  Events events = at_end;
  First first = firstOf(at_end, at_end);
  double beyond = -1.0;  // last negative value of the first event, relative to at_end

  void evaluateEnd() {
    step.slope = evaluate(s, c, c.time + step.h, step.end, Level::kEvents, e);
    step.carrier_deflection_rate = e.motion.carrier_deflection_rate;
  }

  // sets `step` to the part of the whole one up to tau
  bool endAt(double tau) {
    step.h = tau;
    step.end = interpolate(c, whole, tau);
    if (!isFinite(step.end)) return false;
    evaluateEnd();
    return true;
  }

  bool eventsAt(double tau) {
    if (!endAt(tau)) return false;
    events = eventValues(s, c, e);
    return true;
  }

  double valueAt(double tau) {
    if (!eventsAt(tau)) return -1.0;
    const First found = firstOf(events, at_end);
    if (found.value >= 0.0 && broken(events) == 0) return found.value;
    // another event, of a contact that vanished before the end
    if (found.value >= 0.0) at_end = events;
    first = firstOf(events, at_end);
    return first.value;
  }

  double valueOfFirst() const { return events[first.event] / -at_end[first.event]; }
  // Upper end of the bracket of the first zero [s]. Zeros of polynomials plus half the resolution,
  // to reach the negative side; bisection if these converge slowly, geometric if the lower end is
  // the step's start. middle: event functions in the middle of the step, if available.
  double bracket(double high, const Events* middle, double resolution) {
    double low = 0.0;
    SampledEvents samples;
    samples.add(0.0, c.events);
    samples.add(high, at_end);
    double before = high, value_before = -1.0;
    if (middle) {
      samples.add(0.5 * high, *middle);
      (broken(*middle) > 0 ? high : low) *= 0.5;
    }
    for (int i = 0; i < 200 && high - low > resolution; ++i) {
      double next = samples.root(first.event) + 0.5 * resolution;
      const bool near = next > low - resolution && next < high + resolution;
      if (!near || (i > kPolynomials && i % 2 == 0)) {
        const bool order = low == 0.0 && i > kPolynomials;
        next = order ? std::sqrt(0.1 * resolution * high) : 0.5 * (low + high);
      }
      next = std::clamp(next, low + 0.25 * resolution, high - 0.25 * resolution);
      const std::size_t event = first.event;
      const double value = valueAt(next);
      samples.add(next, events);
      if (value >= 0.0) {
        low = next;
      } else {
        high = next;
        beyond = value;
        const double rate = (value - value_before) / (next - before);
        if (event == first.event && -value < -rate * resolution && broken(events) == 1) break;
      }
      before = next;
      value_before = value;
    }
    return high;
  }

  // Repeats the step to tau and corrects its end by the rate of the event function, if that exists.
  void repeatStep(double tau) {
    const double h = whole.h, span = std::min(1e-6, 0.5 * tau);
    double rate = 0.0;
    if (beyond > -kJump && eventsAt(tau - span)) rate = (beyond - valueOfFirst()) / span;
    const Method method = whole.method == Method::kHamming ? Method::kRk4 : whole.method;
    step.h = tau;
    for (int i = 0; i < 3; ++i) {
      attemptStep(s, c, method, step, e);
      if (std::isinf(step.error)) {
        // the step to tau fails: interpolates the longer one
        endAt(step.h);
        break;
      }
      events = eventValues(s, c, e);
      const double f = valueOfFirst();
      double off = rate < 0.0 && std::isfinite(f) ? -f / rate : 0.0;
      if (std::abs(off) < 0.5 * kEventTime || std::abs(off) > 0.1 * h || i == 2) break;
      off = std::clamp(off, -0.5 * step.h, h - step.h);
      step.h += off;
      if (std::abs(off) < kTaylorTime) {
        // the Taylor series with the present slopes is exact to rounding
        step.end.q += off * (step.end.v + 0.5 * off * step.slope);
        step.end.v += off * step.slope;
        step.end.carrier_deflection += off * step.carrier_deflection_rate;
        evaluateEnd();
        break;
      }
    }
  }
};

}  // namespace

// Brackets the zero on the interpolant. A step whose interpolant is as accurate as itself ends
// there; others are repeated to that time and corrected.
void locateEvent(const System& s, const Context& c, const Events& at_end, Trial& step,
                 Evaluation& e) {
  EventSearch search{s, c, step, at_end, step, e};
  const double h = step.h;
  Events middle;
  bool dense = step.method == Method::kDopri5 && !s.compliant && h > kRefined;
  if (dense) {
    dense = refine(s, c, search.whole, e) <= kDense;
    middle = eventValues(s, c, e);
    // if no slot closes at the end and in the middle, open slots are not searched
    e.watched = !dense || e.face || closes(s, e, at_end) || closes(s, e, middle);
  }
  // accuracy of the interpolant of other steps; with discrete friction a thousandth of the
  // tolerance at 1 m/s, scaled as the hysteresis of forces
  const double worth = dense ? 0.0 : 1e-7 * h;
  const double time = kEventTime * (s.discrete_friction ? std::max(0.1, s.coarseness) : 0.1);
  const double resolution = std::max({time, 4e-16 * std::abs(c.time), worth});
  double end = search.bracket(h, dense ? &middle : nullptr, resolution);
  if (!dense) return search.repeatStep(end);
  if (!e.watched) {
    e.watched = true;
    if (step.h != end) {
      search.endAt(end);
    } else {
      locate(s, c, s.admitted & ~e.closed, e, e.open_set);
    }
    const Events found = eventValues(s, c, e);
    if (closes(s, e, found)) {
      search.at_end = search.events = found;
      search.first = firstOf(found, found);
      end = search.bracket(step.h, nullptr, resolution);
    }
  }
  if (step.h != end) search.endAt(end);
}

}  // namespace assembly_cell
