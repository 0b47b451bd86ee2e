// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "contact_modes.h"

#include <algorithm>

#include "contact_solver.h"
#include "contact_tolerances.h"
#include "face/face.h"
#include "face/face_edge.h"
#include "face/face_points.h"
#include "impact/impact.h"
#include "integration/event_locator.h"
#include "mode_search.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Slip speed over its threshold below which stick is tried; above 1, as slip ends at events located
// at the threshold. Half: events without end, 4.7 times the effort in Chapter 8; twice: 2 % more,
// 0.03 um.
constexpr double kRest = 1.5;
// The same of a face that has begun to slip, for its fastest point; below 1.5, as the friction at
// the onset and that along the velocity may cancel. 1.1, 1.4 and 2 in pegs pushed into the corner
// of floor and wall: effort −7 %, +24 %, +5 %.
constexpr double kFaceRest = 1.2;
// Slip opposite to its onset below this fraction of the threshold is ignored. Half and twice,
// there: nothing and −1 %.
constexpr double kAstray = 0.01;
// Minimum cosine of the angle between slip and the direction opposite to friction for consistent
// slip. Half and twice (no slip is consistent): 3 and 4 of 400 scenes end elsewhere; wedged pegs
// take 1 % and 52 % more.
constexpr double kAhead = 0.9;
// Correction of a gap at an event above which the energy is limited; above the error of an event,
// 1e-12 s at 1 m/s. Half: 3 of 400 scenes end elsewhere; twice: no result changes.
constexpr double kLift = 1e-11;  // [m]
// Distance over the radius, and of the unit normals, below which two contact points coincide when
// one feature takes over from another.
constexpr double kSamePlace = 1e-6;
// Limits of the iterations at one decision: moves of the points of a face, whose friction depends
// on them; secant steps of at most kTipStep for the tipping point, to an accuracy of kTip.
constexpr int kFaceMoves = 4, kFaceTurns = 12;
constexpr double kTip = 1e-9, kTipStep = 0.5;  // [rad]

// A point that begins to slip accelerates along its friction: the slip is inconsistent. The points
// then stick with a larger internal force than kLoads allows.
bool slipsAstray(const System& s, double limit, const Context& c, const Evaluation& e) {
  int resting = 0;
  for (const std::size_t i : Slots(e.active())) resting += c.slots[i].armed ? 0 : 1;
  if (resting < 2) return false;
  const Body body = bodyOf(s, e.k);
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode != Mode::kSlip || c.slots[i].armed) continue;
    const Vec3& normal = e.point(i).normal;
    const Vec3 friction = e.contacts[i].force - e.contacts[i].normal_force * normal;
    if (accelerationOf(body, e, i).dot(friction) > limit * friction.norm()) return true;
  }
  return false;
}

// Stops the remaining slip of these points by an impulse.
void stopSlip(const System& s, ContactSlotMask points, Context& c, Evaluation& e) {
  Constraints rows;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode == Mode::kIdle) continue;
    const ContactKinematics& at = e.contacts[i];
    const bool stop = (points >> i & 1u) != 0;
    Constraint& row = rows.add(i, at.r, e.point(i).normal);
    row.stick = stop || c.slots[i].mode == Mode::kStick;
    row.change = stop ? Vec3(-at.tangential) : Vec3(Vec3::Zero());
  }
  solveConstraints(bodyOf(s, e.k), rows);
  applyImpulse(s, rows.total(), c, e);
}

// Points that slipped and rest now.
ContactSlotMask cameToRest(const Context& c, ContactSlotMask slid, const Evaluation& e) {
  ContactSlotMask resting = 0;
  for (const std::size_t i : Slots(slid & e.active())) {
    if (c.slots[i].mode == Mode::kStick) resting |= 1u << i;
  }
  return resting;
}

// Friction of beginning slip with another direction than its onset is set opposite to the velocity.
// Slip that this decelerates would end at once: it is stopped, as is a remainder of earlier slip in
// the opposite direction. True if modes are to be decided again.
bool stopTurnedSlip(const System& s, Context& c, Evaluation& e) {
  ContactSlotMask turned = 0, stops = 0;
  for (const std::size_t i : Slots(e.active())) {
    Slot& slot = c.slots[i];
    if (slot.mode != Mode::kSlip || slot.armed) continue;
    const Vec3& slip = e.contacts[i].tangential;
    if (slipAhead(s, slot, i, e) < 0.0) {
      slot.armed = true;
      turned |= 1u << i;
    } else if (!s.rigid && slip.dot(slot.slip_direction) > 0.0 &&
               slip.norm() > kAstray * slipThreshold(s, e)) {
      stops |= e.face >> i & 1u ? e.active() & e.face : 1u << i;
    }
  }
  if (!turned && !stops) return false;
  if (turned) c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
  const Body body = bodyOf(s, e.k);
  for (const std::size_t i : Slots(turned)) {
    if (accelerationOf(body, e, i).dot(e.contacts[i].tangential) < 0.0) stops |= 1u << i;
  }
  if (stops) stopSlip(s, stops, c, e);
  return stops != 0;
}

// Moves the points of a face with its load, as friction depends on them. With the load at the edge,
// the peg tips about the point whose neighbours have no decreasing gap (secant iteration).
void settleFace(const System& s, double limit, Context& c, Evaluation& e) {
  bool moved = false;
  for (int n = 0; n < kFaceMoves; ++n) {
    if (s.discrete_friction) solveSlipDirections(s, limit, c, e);
    if (!moveFacePoints(s, limit, c, e)) break;
    iterateModes(s, false, limit, c, e);
    moved = true;
  }
  if (!moved && !c.face.overHole()) return;
  double at = c.face.t[tippingSlot(c)], error = tippingError(s, limit, c, e), slope = 1.0;
  for (int n = 0; n < kFaceTurns && std::abs(error) > kTip; ++n) {
    const double next = at + std::clamp(error / slope, -kTipStep, kTipStep);
    tipAbout(s, next, c, e);
    iterateModes(s, false, limit, c, e);
    if (s.discrete_friction) solveSlipDirections(s, limit, c, e);
    const double left = tippingError(s, limit, c, e), way = next - at;
    slope = std::max((error - left) / way, kTip);
    at = next;
    error = left;
  }
}

void decideRegularised(const System& s, Context& c, Evaluation& e) {
  double scale = kMinScale;
  for (const std::size_t i : Slots(e.closed)) c.slots[i].mode = Mode::kIdle;
  for (const std::size_t i : Slots(e.active())) {
    scale = std::max(scale, std::abs(e.point(i).normal.dot(e.free.head<3>())));
  }
  c.approach = 1e-4 * kHysteresis * scale;
  c.pull = c.approach * s.scenario.mechanism.peg.mass;
  c.slope = e.closed ? chooseCarriers(s, c.slots, e) : e.free;
  if (c.face.on) settleFace(s, c.approach, c, e);
}

// wedgeMargin() at or below the event of a Painlevé impact.
bool isWedged(const Evaluation& e) { return e.wedge_margin < 2.0 * kWedged; }

// Measures taken at this decision against inconsistent slip: stopped; Painlevé impact of some, of
// all points.
enum class Tried { kNothing, kStop, kJam, kJamAll };

void decide(const System& s, Tried tried, Context& c, Evaluation& e) {
  c.stale = false;
  ++c.decisions;
  e.wedge_margin = 1.0;
  const bool known = e.present && !c.face.on;
  e.present = false;
  if (!known) evaluateFree(s, c.commands, c.time, c.state, e);
  if (!s.admitted) {
    c.slope = e.free;
    return;
  }
  if (!known) locateAll(s, c, e);
  if (!s.discrete_friction || !e.closed) {
    decideRegularised(s, c, e);
    beginStep(s, c, e);
    return;
  }
  ContactSlotMask slid = 0;
  for (const std::size_t i : Slots(e.active())) {
    Slot& slot = c.slots[i];
    if (slot.mode == Mode::kSlip && slot.armed) slid |= 1u << i;
    slot.armed = slipSpeed(e, i) > kRest * slipThreshold(s, e);
    slot.mode = slot.armed ? Mode::kSlip : Mode::kStick;
  }
  double limit = 0.0;
  iterateModes(s, true, limit, c, e);
  if (c.face.on) settleFace(s, limit, c, e);
  solveSlipDirections(s, limit, c, e);
  if (!s.rigid) enumerateModes(s, limit, c, e);
  if (!s.rigid && e.loads < kWedgeLoads && slipsAstray(s, limit, c, e)) {
    e.loads = kWedgeLoads;
    return decide(s, tried, c, e);
  }
  if (tried == Tried::kNothing && stopTurnedSlip(s, c, e)) return decide(s, Tried::kStop, c, e);
  if (const ContactSlotMask rest = cameToRest(c, slid, e);
      rest && tried == Tried::kNothing && !s.rigid && !s.scenario.thesis.creep) {
    stopSlip(s, rest, c, e);
    return decide(s, Tried::kStop, c, e);
  }
  if (!s.rigid && tried != Tried::kJamAll && slips(c.slots) &&
      (isWedged(e) || worstViolation(s, c, e) > limit * s.scenario.mechanism.peg.mass)) {
    const bool everything = tried == Tried::kJam;
    painleveImpact(s, everything, c, e);
    return decide(s, everything ? Tried::kJamAll : Tried::kJam, c, e);
  }
  if (s.rigid && c.time >= c.zeno_until) {
    if (project(s, c, e)) c.slope = evaluate(s, c, c.time, c.state, Level::kEvents, e);
  }
  beginStep(s, c, e);
}

// Gap of a closed contact that coincides with an open one, which takes over from it [m]; 0 if there
// is none.
double heldAt(const System& s, std::size_t open, const Evaluation& e) {
  const ContactPoint& point = e.point(open);
  double gap = 0.0;
  for (const std::size_t i : Slots(e.active())) {
    const bool same =
        (e.point(i).p - point.p).norm() < kSamePlace * s.scenario.mechanism.peg.radius &&
        e.point(i).normal.dot(point.normal) > 1.0 - kSamePlace;
    if (same) gap = std::min(gap, e.contacts[i].gap);
  }
  return gap;
}

}  // namespace

void setMode(std::size_t i, Mode mode, Context& c, Evaluation& e) {
  const ContactSlotMask bit = 1u << i;
  const bool was = (e.closed & bit) != 0, is = mode != Mode::kApart;
  c.slots[i].mode = mode;
  if (was == is) return;
  const ContactSet& from = was ? e.closed_set : e.open_set;
  ContactSet& to = was ? e.open_set : e.closed_set;
  to.slots[i] = from.slots[i];
  to.valid = (to.valid & ~bit) | (from.valid & bit);
  e.closed ^= bit;
}

void findModes(const System& s, bool initial, Context& c, Evaluation& e) {
  dropFace(c, e);
  for (std::size_t i = 0; i < kSlots; ++i) setMode(i, Mode::kApart, c, e);
  if (s.admitted) {
    evaluatePresent(s, c, e);
    bool closing = false;
    for (const std::size_t i : Slots(s.admitted & e.open_set.valid)) {
      const double gap = e.contacts[i].gap, rate = e.contacts[i].gap_rate;
      if (initial && s.rigid && gap < -kInitialReach) {
        c.stop = StopReason::kInitialOverlap;
        return;
      }
      const bool touching = gap <= (initial ? kInitialReach : kReach) && rate <= 1e-12;
      if (!(gap < 0.0 || touching)) continue;
      setMode(i, s.discrete_friction ? Mode::kIdle : Mode::kSlip, c, e);
      c.slots[i].armed = false;
      if (!initial && s.rigid) keepDepth(i, 0.0, c, e);
      closing = closing || rate < 0.0;
    }
    beginFace(s, c, e);
    if (s.rigid && (initial || closing)) faceImpact(s, c, e);
  }
  decide(s, c, e);
}

void findModesWithin(const System& s, double limit, Context& c, Evaluation& e) {
  findModes(s, false, c, e);
  if (!(energyOf(s, c, e) > limit)) return;
  limitEnergy(s, limit, c, e);
  decide(s, c, e);
}

void changeModes(const System& s, Context& c, Evaluation& e) {
  const double before = s.rigid ? energyOf(s, c, e) : 0.0;
  const bool wedged = !s.rigid && isWedged(e);
  bool closed = false, lost = false;
  double handed = 0.0;  // smallest gap of contacts without a point
  closed = updateFace(s, c, e);
  if (beginFace(s, c, e)) closed = true;
  for (const std::size_t i : Slots(e.closed)) {
    const ContactKinematics& at = e.contacts[i];
    if (!e.valid(i) || at.gap >= s.leave_gap) {
      lost = lost || !e.valid(i);
      if (!e.valid(i) && !s.rigid) handed = std::min(handed, at.gap);
      setMode(i, Mode::kApart, c, e);
    } else if (s.rigid && c.slots[i].mode == Mode::kIdle && at.gap < 0.0) {
      closed = closed || at.gap_rate < -kSettledSpeed;
    }
  }
  // of a contact that takes over from another feature the gap is zero
  for (const std::size_t i : Slots(s.admitted & ~e.closed & e.open_set.valid)) {
    const double gap = e.contacts[i].gap, rate = e.contacts[i].gap_rate;
    const bool closes = gap < 0.0 && !(s.rigid && gap > -kReach && rate > 0.0);
    const bool at_event = gap <= 2.0 * kEventTime * std::abs(rate) && rate < 0.0;
    if (!closes && !at_event && !(lost && gap < kReach)) continue;
    const double here = s.rigid ? 0.0 : std::min(handed, heldAt(s, i, e));
    setMode(i, s.discrete_friction ? Mode::kIdle : Mode::kSlip, c, e);
    c.slots[i].armed = false;
    // where a face can rest, the error of a step is corrected by project()
    const bool error = s.rigid && gap > -s.scenario.solver.tolerance && canRestOnFace(s, e.edge);
    if (s.scenario.contact.law != ContactLaw::kViscous && !error) keepDepth(i, here, c, e);
    if (rate < -1e-9) {
      ++c.counts.impacts;
      closed = true;
    }
  }
  if (beginFace(s, c, e)) closed = true;
  // a slot without a point may have one elsewhere
  if (closed || lost) e.present = false;
  if (closed && s.rigid) faceImpact(s, c, e);
  // beyond the paradox another set of points may be consistent, but the impact came before
  if (wedged && !closed && !lost) painleveImpact(s, false, c, e);
  decide(s, c, e);
  if (s.rigid && e.closed &&
      energyOf(s, c, e) > before + kLift * freeAcceleration(s, e) * s.scenario.mechanism.peg.mass) {
    limitEnergy(s, before, c, e);
    decide(s, c, e);
  }
}

void decide(const System& s, Context& c, Evaluation& e) {
  e.loads = kLoads;
  decide(s, Tried::kNothing, c, e);
  c.carrier_deflection_rate = e.motion.carrier_deflection_rate;
}

void keepDepth(std::size_t i, double handed, Context& c, Evaluation& e) {
  const double deeper = e.contacts[i].gap - handed;
  if (deeper >= -kFound) return;
  c.slots[i].depth += deeper;
  e.contacts[i].gap = handed;
}

void updateSlots(const System& s, Context& c, Evaluation& e) {
  for (const std::size_t i : Slots(s.admitted)) {
    double& depth = c.slots[i].depth;
    if (depth == 0.0) continue;
    depth = e.valid(i) ? std::min(0.0, std::max(depth, e.point(i).gap)) : 0.0;
    if (e.valid(i) && c.slots[i].mode == Mode::kApart) e.contacts[i].gap = e.point(i).gap - depth;
  }
  for (const std::size_t i : Slots(e.closed)) {
    Slot& slot = c.slots[i];
    if (slot.mode == Mode::kSlip && s.discrete_friction &&
        slipSpeed(e, i) > 2.0 * slipThreshold(s, e)) {
      slot.armed = true;
    }
    if (slot.mode == Mode::kIdle && e.valid(i) && e.contacts[i].gap >= s.leave_gap) {
      setMode(i, Mode::kApart, c, e);
    }
  }
}

double slipAhead(const System& s, const Slot& slot, std::size_t i, const Evaluation& e) {
  const ContactKinematics& at = e.contacts[i];
  const double against = -at.tangential.dot(slot.slip_direction);
  // the points of a face rest together, by the fastest
  const double rest = (e.face >> i & 1u ? kFaceRest : 1.0) * slipThreshold(s, e);
  if (s.rigid) return rest + against;
  if (s.scenario.mechanism.friction.sliding_coefficient == 0.0) return HUGE_VAL;
  const double speed = at.tangential.norm();
  return std::max(rest - speed, against - kAhead * speed);
}

}  // namespace assembly_cell
