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

// A step is lengthened by less than this without a new one: a third order term of 1e-27 s³. Half
// and twice: 61 and 58 of 400 random scenes, those with many impacts, end elsewhere, effort −3 %
// and −1 %.
constexpr double kTaylorTime = 1e-9;  // [s]
// An idle contact that goes on approaching is hit there, over kTouch: 3 of 400 scenes, by 0.1 um.
constexpr double kIdleDepth = 1e-12;  // [m]
// An event function that is so far below zero, of its value at the step's end, within the
// resolution of its place has jumped: a contact point that is lost. No result changes at half or
// twice.
constexpr double kJump = 1e-3;
// Longer steps are looked at inside, too, once for each such part of a turn of the exciter: a
// contact is shaken loose and caught within it. Half: no result changes; twice: one jammed run of
// six does.
constexpr double kBlindPhase = 0.3;  // [rad]
// So are those in which friction could have ended a slip, that begins again before the end; steps
// of slow_slip.h see that themselves.
constexpr double kBlindSlip = 1.0;
constexpr int kMostLooks = 8;
// As many are spared where closed slots were far from events at two stages, 0.3 and 0.8 of a step
// of dopri5, which are off by its third order: all that looks found in 200 vibrated runs was found.
constexpr int kStageLooks = 2;
// An event is looked for by so many polynomials, then by halves in turn. One less and one more: the
// same events, within 0.2 % of their evaluations.
constexpr int kPolynomials = 3;
// Shorter steps are taken anew: what the interpolant gains there is in its rounding [s].
constexpr double kRefined = 1e-6;
// So are those of which the middle changes the interpolant by more than this part of the tolerance.
// No result of the suite changes at half or twice of either; without it a rocking face is off by
// 3.6 tolerances.
constexpr double kDense = 1.0;

// Slip along that at the step's start; of a face that of the point that goes on fastest.
double onwards(const Context& c, const Evaluation& e, std::size_t i) {
  double fastest = e.contacts[i].tangential.dot(c.slots[i].slip_start);
  if (!(e.face >> i & 1u)) return fastest;
  for (const std::size_t j : Slots(e.active() & e.face)) {
    if (!c.slots[j].armed || c.slots[j].mode != Mode::kSlip) continue;
    fastest = std::max(fastest, e.contacts[j].tangential.dot(c.slots[j].slip_start));
  }
  return fastest;
}

// gap, normal force, friction of a closed contact
void slotEvents(const System& s, const Context& c, const Evaluation& e, std::size_t i,
                double* value) {
  const Slot& slot = c.slots[i];
  const ContactKinematics& at = e.contacts[i];
  if (slot.mode == Mode::kIdle) {
    if (s.rigid) {
      // out of reach it asks for nothing any more
      if (at.gap < s.leave_gap) value[1] = at.demand + c.approach;
      if (at.gap_rate < -kSettledSpeed) value[0] = at.gap + kIdleDepth;
    } else {
      // what it asks for before it is out of reach is seen at a step's end beyond, too
      value[0] = s.leave_gap - at.gap;
      value[1] = at.demand + c.approach;
    }
    return;
  }
  value[0] = s.leave_gap - at.gap;
  if (!s.discrete_friction) {
    // the branch that friction has been on, a rounding beyond its end
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

// Of the events that are broken at the end the one that is first, each against its value there.
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
      // a rigid contact that is just leaving may still be at its rounding
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

// When within the step an open gap that shrinks at its start and grows at its end is below zero, by
// a cubic; 0 where none is.
double dipOfOpen(const Context& c, const Trial& step, const Evaluation& e) {
  for (const std::size_t i : Slots(e.open_set.valid & ~e.closed)) {
    const Slot& slot = c.slots[i];
    const double v0 = step.h * slot.gap_rate, v1 = step.h * e.contacts[i].gap_rate;
    if (slot.mode != Mode::kApart || !(slot.gap < HUGE_VAL && v0 < 0.0 && v1 > 0.0)) continue;
    const double d = e.contacts[i].gap - slot.gap;
    const double c2 = 3.0 * d - 2.0 * v0 - v1, c3 = v0 + v1 - 2.0 * d;
    // the rate is zero there: c3 = 0 for a parabola
    const double root = std::sqrt(std::max(0.0, c2 * c2 - 3.0 * c3 * v0));
    const double u = -v0 / (c2 + root);
    if (u > 0.0 && u < 1.0 && slot.gap + u * (v0 + u * (c2 + u * c3)) < -kTouch) return u * step.h;
  }
  return 0.0;
}

// When an event function of a closed slot is farthest below zero, by cubics through its values at
// both ends and the stages; 0 where none is.
double dipOfClosed(const Context& c, const Trial& step, const Events& at_end,
                   ContactSlotMask closed) {
  double least = 0.0, at = 0.0;
  for (const std::size_t i : Slots(closed & ~step.stages.shared)) {
    for (std::size_t kind = 0; kind < kEventKinds; ++kind) {
      const double f0 = c.events.ofSlot(i)[kind], f1 = step.stages.value[0][i][kind];
      const double f2 = step.stages.value[1][i][kind], f3 = at_end.ofSlot(i)[kind];
      if (!(std::max({f0, f1, f2, f3}) < HUGE_VAL)) continue;
      // divided differences, and what they make of powers of the part of the step
      const double d01 = (f1 - f0) / 0.3, d12 = (f2 - f1) / 0.5, d23 = (f3 - f2) / 0.2;
      const double d012 = (d12 - d01) / 0.8, c3 = (d23 - d12) / 0.7 - d012;
      const double c1 = d01 - 0.3 * d012 + 0.24 * c3, c2 = d012 - 1.1 * c3;
      const double square = c2 * c2 - 3.0 * c3 * c1;
      if (!(c1 < 0.0 && square > 0.0)) continue;
      const double u = -c1 / (c2 + std::sqrt(square));
      const double value = f0 + u * (c1 + u * (c2 + u * c3));
      if (!(u > 0.0 && u < 1.0 && value < least)) continue;
      least = value;
      at = u * step.h;
    }
  }
  return at;
}

// Exciter or friction turn so far within the step that an event may hide in it.
bool isBlind(const Context& c, const Trial& step) {
  const bool turns = step.method != Method::kSlowSlip && step.h * c.slip_turning > kBlindSlip;
  return turns || step.h * c.commands.drive.exciter.frequency >= kBlindPhase;
}

// all closed slots are far from events at the stages
bool staysInside(const StageEvents& stages, ContactSlotMask closed) {
  if (!stages.told) return false;
  for (const auto& stage : stages.value) {
    for (const std::size_t i : Slots(closed)) {
      if (*std::min_element(stage[i].begin(), stage[i].end()) < 0.0) return false;
    }
  }
  return true;
}

}  // namespace

void noteStage(const System& s, const Context& c, const Evaluation& e, int stage,
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
      stages.told = false;
    }
  }
}

double hiddenEvent(const System& s, const Context& c, const Trial& step, const Events& at_end,
                   Evaluation& e, Evaluation& inside) {
  if (s.fixed_step) return 0.0;
  const double phase = step.h * c.commands.drive.exciter.frequency;
  const int looks = std::clamp(static_cast<int>(phase / kBlindPhase), 1, kMostLooks);
  const double dips[] = {dipOfOpen(c, step, e),
                         step.stages.noted ? dipOfClosed(c, step, at_end, e.closed) : 0.0};
  const bool seen = looks <= kStageLooks && staysInside(step.stages, e.closed);
  const bool blind = e.closed && !seen && isBlind(c, step);
  if (dips[0] == 0.0 && dips[1] == 0.0 && !blind) return 0.0;
  inside = e;
  const auto broken_at = [&](double tau) {
    evaluate(s, c, c.time + tau, interpolate(c, step, tau), Level::kEvents, inside);
    e.count = inside.count;
    return broken(eventValues(s, c, inside)) > 0;
  };
  for (const double tau : dips) {
    if (tau > 0.0 && broken_at(tau)) return tau;
  }
  for (int i = 1; blind && i <= looks; ++i) {
    const double tau = step.h * i / (looks + 1);
    if (broken_at(tau)) return tau;
  }
  return 0.0;
}

namespace {

// Some open slot has an event below zero.
bool closes(const System& s, const Evaluation& e, const Events& events) {
  for (const std::size_t i : Slots(s.admitted & ~e.closed)) {
    const double* const value = events.ofSlot(i);
    if (*std::min_element(value, value + kEventKinds) < 0.0) return true;
  }
  return false;
}

// What the event functions were at the last times that were looked at.
class Seen {
 public:
  void add(double at, const Events& events) {
    newest_ = (newest_ + 1) % kMost;
    at_[newest_] = at;
    events_[newest_] = events;
    size_ = std::min(size_ + 1, kMost);
  }

  // Where the polynomial through them is zero, for one event, by Newton's method from where the
  // line through the last two is; HUGE_VAL where there is none.
  double root(std::size_t event) const {
    std::array<double, kMost> at, part;  // divided differences
    std::size_t n = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const std::size_t k = (newest_ + kMost - i) % kMost;
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
  static constexpr std::size_t kMost = 4;
  static constexpr int kNewton = 4;
  std::array<double, kMost> at_{};
  std::array<Events, kMost> events_;
  std::size_t newest_ = 0, size_ = 0;
};

// The search for the first event within a step that was tried.
struct EventSearch {
  const System& s;
  const Context& c;
  Trial whole;    // as it was tried
  Events at_end;  // of its end, all below zero that are looked for
  Trial& step;
  Evaluation& e;
  Events events = at_end;
  First first = firstOf(at_end, at_end);
  double beyond = -1.0;  // of the first event, where it was last seen below zero

  void evaluateEnd() {
    step.slope = evaluate(s, c, c.time + step.h, step.end, Level::kEvents, e);
    step.give_rate = e.motion.give_rate;
  }

  // `step` is the part of the whole one up to tau.
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
    // or another, whose contact was lost before the end
    if (found.value >= 0.0) at_end = events;
    first = firstOf(events, at_end);
    return first.value;
  }

  double valueOfFirst() const { return events[first.event] / -at_end[first.event]; }
  // The end of a bracket: by polynomials, a little beyond their zeros, to come to the far side;
  // where these don't end soon, by halves: of the bracket, or of its order where low is the step's
  // start. middle: events in the middle of the step, if they are known.
  double bracket(double high, const Events* middle, double resolution) {
    double low = 0.0;
    Seen seen;
    seen.add(0.0, c.events);
    seen.add(high, at_end);
    double before = high, value_before = -1.0;
    if (middle) {
      seen.add(0.5 * high, *middle);
      (broken(*middle) > 0 ? high : low) *= 0.5;
    }
    for (int i = 0; i < 200 && high - low > resolution; ++i) {
      double next = seen.root(first.event) + 0.5 * resolution;
      const bool near = next > low - resolution && next < high + resolution;
      if (!near || (i > kPolynomials && i % 2 == 0)) {
        const bool order = low == 0.0 && i > kPolynomials;
        next = order ? std::sqrt(0.1 * resolution * high) : 0.5 * (low + high);
      }
      next = std::clamp(next, low + 0.25 * resolution, high - 0.25 * resolution);
      const std::size_t event = first.event;
      const double value = valueAt(next);
      seen.add(next, events);
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

  // The step anew to tau, corrected by the slope of the event's function, where it has one.
  void takeAnew(double tau) {
    const double h = whole.h, span = std::min(1e-6, 0.5 * tau);
    double rate = 0.0;
    if (beyond > -kJump && eventsAt(tau - span)) rate = (beyond - valueOfFirst()) / span;
    const Method method = whole.method == Method::kHamming ? Method::kRk4 : whole.method;
    step.h = tau;
    for (int i = 0; i < 3; ++i) {
      attemptStep(s, c, method, step, e);
      if (std::isinf(step.error)) {
        // no step ends there: what the longer one says of it
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
        // so near that the slopes at hand are exact
        step.end.q += off * (step.end.v + 0.5 * off * step.slope);
        step.end.v += off * step.slope;
        step.end.give += off * step.give_rate;
        evaluateEnd();
        break;
      }
    }
  }
};

}  // namespace

// Bracketed on the interpolant. A step whose interpolant has its own order ends there; others are
// taken anew to exactly there and corrected if the event functions are off.
void locateEvent(const System& s, const Context& c, const Events& at_end, Trial& step,
                 Evaluation& e) {
  EventSearch search{s, c, step, at_end, step, e};
  const double h = step.h;
  Events middle;
  bool dense = step.method == Method::kDopri5 && !s.compliant && h > kRefined;
  if (dense) {
    dense = refine(s, c, search.whole, e) <= kDense;
    middle = eventValues(s, c, e);
    // where none closes at end and middle, open slots needn't be searched on the way
    e.watched = !dense || e.face || closes(s, e, at_end) || closes(s, e, middle);
  }
  // the interpolant of another step is not worth more; of discrete friction a thousandth of the
  // tolerance at 1 m/s, as far as the hysteresis of its forces follows that
  const double worth = dense ? 0.0 : 1e-7 * h;
  const double time = kEventTime * (s.discrete_friction ? std::max(0.1, s.coarseness) : 0.1);
  const double resolution = std::max({time, 4e-16 * std::abs(c.time), worth});
  double end = search.bracket(h, dense ? &middle : nullptr, resolution);
  if (!dense) return search.takeAnew(end);
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
