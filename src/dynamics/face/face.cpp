// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "face.h"

#include <algorithm>
#include <cmath>

#include "contact/contact_modes.h"
#include "contact/contact_solver.h"
#include "contact/contact_tolerances.h"
#include "face_edge.h"
#include "face_points.h"
#include "impact/impact.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Half and twice of each were tried in 181 level random scenes of test/stress; those with many
// impacts are sensitive to any change.

// Height of the highest point of a face below which it is in contact: half of the tolerance, and at
// most half of kReach. Half and twice: 9 and 10 scenes end elsewhere, effort +10 % and −2 %.
constexpr double kContactHeight = 0.5, kMaxContactHeight = 5e-10;  // over the tolerance; [m]
// That height under the rigid law, which sets gaps to zero: the resolution of an event. At 1e-12
// and 1e-11, 7 and 3 of 485 scenes of test_agreement exceed the tolerance, here 4.
constexpr double kRigidContactHeight = 3e-13;  // [m]
// Hysteresis: height at which a face contact opens, over that at which it closes. Half and twice:
// 15 and 17 scenes, effort +5 % and +3 %.
constexpr double kOpenRatio = 4.0;
constexpr int kStrikes = 8;  // maximum number of sequential points of one impact
// Height of a rebound below which the face is stopped, to end rocking whose impacts otherwise
// continue down to the rounding of a gap. A tenth and ten times: 9 and 11 scenes instead of 10 of
// 486 exceed the tolerance, with 12 times and 0.96 times the effort.
constexpr double kLastRise = 1e-14;  // [m]

// Height of the highest point at which a face contact closes [m]; below zero where contacts open at
// zero gap.
double contactHeight(const System& s) {
  if (!s.discrete_friction) return 0.5 * kTouch;
  if (s.fixed_step) return kMaxContactHeight;
  return s.rigid ? kRigidContactHeight
                 : std::min(kMaxContactHeight, kContactHeight * s.scenario.solver.tolerance);
}

double leaves(const System& s) {
  return kOpenRatio * (s.discrete_friction ? contactHeight(s) : kMaxContactHeight);
}
double beside(const System& s) {
  return s.discrete_friction ? contactHeight(s) : kMaxContactHeight;
}

// Smallest gap of the closed points [m]; 0 if none is closed.
double deepestPoint(const Evaluation& e) {
  double deepest = 0.0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    deepest = std::min(deepest, e.point(i).gap);
  }
  return deepest;
}

// Largest gap of the points over the zero of their springs [m].
double highestPoint(const Evaluation& e) {
  double highest = -HUGE_VAL;
  for (const std::size_t i : Slots(kFaceSlots)) highest = std::max(highest, e.contacts[i].gap);
  return highest;
}

// Returns to the contact of the lowest edge point; with springs it continues the most loaded one.
void endFace(const System& s, Context& c, Evaluation& e) {
  const bool touched = (e.active() & kFaceSlots) != 0;
  double pressed = 0.0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    if (hasSprings(s)) pressed = std::min(pressed, e.contacts[i].gap);
  }
  dropFace(c, e);
  locate(s, c, s.admitted & ~e.closed, e, e.open_set);
  for (const std::size_t i : Slots(e.open_set.valid & kFaceSlots)) {
    if (!touched || e.contacts[i].gap > s.leave_gap) continue;
    setMode(i, Mode::kIdle, c, e);
    if (s.scenario.contact.law != ContactLaw::kViscous) keepDepth(i, pressed, c, e);
  }
}

// Slot of a face over the hole for the parameter t: that of a crossing at an end of the arc, else
// the plane slot.
std::size_t slotOf(const Arc& arc, double t) {
  if (arc.has(t)) return *Slots(kFacePlaneSlot);
  return std::remainder(t - arc.about, 2.0 * M_PI) < 0.0 ? 0 : 1;
}

// One of these slots whose point carries no load; kSlots if all carry.
std::size_t sparePoint(ContactSlotMask slots, const Context& c, const Evaluation& e) {
  std::size_t spare = kSlots;
  for (const std::size_t i : Slots(slots)) {
    if (c.slots[i].mode == Mode::kApart) return i;
    if (c.slots[i].mode == Mode::kIdle || e.contacts[i].force.isZero()) spare = i;
  }
  return spare;
}

// The rebound of this speed is below kLastRise.
bool barelyRises(const System& s, double speed, const Evaluation& e) {
  return speed * speed <= 2.0 * kLastRise * freeAcceleration(s, e);
}

// Stops the normal speed of the closed points of these slots by impulses with the friction of their
// slip. To first order in the remaining speed this equals the remaining impacts, in any order.
void stopPoints(const System& s, ContactSlotMask points, Context& c, Evaluation& e) {
  Constraints rows;
  for (const std::size_t i : Slots(points & e.active())) {
    const ContactKinematics& at = e.contacts[i];
    const Vec3& normal = e.point(i).normal;
    Constraint& row = rows.add(i, at.r, normal);
    const double speed = at.tangential.norm();
    row.stick = speed < slipThreshold(s, e);
    row.change = -(row.stick ? at.velocity : Vec3(at.gap_rate * normal));
    if (!row.stick) {
      row.direction -= s.scenario.mechanism.friction.sliding_coefficient / speed * at.tangential;
    }
  }
  solveConstraints(bodyOf(s, e.k), rows);
  applyImpulse(s, rows.total(), c, e);
}

// Stops a face whose remaining rebounds are below kLastRise. Returns whether it did.
bool stopFace(const System& s, Context& c, Evaluation& e) {
  const Round height = heights(c, e.edge), speed = speeds(e);
  if (height.max(groundOf(s, e.edge, c.face.overHole())) > contactHeight(s)) return false;
  if (!barelyRises(s, std::abs(speed.middle) + speed.swing(), e)) return false;
  closePoints(s, kFaceSlots & ~e.active(), c, e);
  stopPoints(s, kFaceSlots, c, e);
  return true;
}

// Ends the rocking of sequential impacts of points, as of a peg on two crossings.
void endRocking(const System& s, Context& c, Evaluation& e) {
  ContactSlotMask left = 0;
  for (const std::size_t i : Slots(s.admitted & ~e.closed & e.open_set.valid)) {
    if (e.contacts[i].gap < contactHeight(s) && barelyRises(s, e.contacts[i].gap_rate, e))
      left |= 1u << i;
  }
  if (!left || !e.active()) return;
  for (const std::size_t i : Slots(e.active())) {
    if (!barelyRises(s, e.contacts[i].gap_rate, e)) return;
  }
  for (const std::size_t i : Slots(left)) setMode(i, Mode::kIdle, c, e);
  stopPoints(s, e.active(), c, e);
}

}  // namespace

void beginFaceStep(Context& c, const Evaluation& e) {
  for (const std::size_t i : Slots(e.active() & kFacePlaneSlot)) {
    c.face.across = e.point(i).t + M_PI;
  }
}

double faceEvent(const System& s, const Context& c, const Evaluation& e) {
  const Round height = heights(c, e.edge);
  if (!c.face.on) {
    // the point opposite to the one that carried at the step's start, which stays down
    if (!(e.closed & kFacePlaneSlot) || !nearlyLevel(e.edge)) return HUGE_VAL;
    const double up = height.middle + c.face.height - groundUnder(s, e.edge);
    const Round over{up, height.cosine, height.sine};
    const double t = c.face.across;
    if (!hasGround(s, e.edge)) {
      // and the ends of the arc beside the hole, also if the lowest point has passed into the hole
      if (!reachesOver(s, e.edge)) return HUGE_VAL;
      const Arc arc = groundOf(s, e.edge, true);
      const double ends = std::max(over.at(arc.from()), over.at(arc.to()));
      return (arc.has(t) ? std::max(ends, over.at(t)) : ends) - contactHeight(s);
    }
    // with springs, two points beside it, which carry no load then
    return hasSprings(s) ? std::max(over.at(t + 0.5 * kFaceTurn), over.at(t - 0.5 * kFaceTurn))
                         : over.at(t) - contactHeight(s);
  }
  const double ground = sameGround(s, c.face, e.edge);
  if (hasSprings(s)) return std::min(ground, leaves(s) - highestPoint(e));
  const bool all = (e.active() & kFaceSlots) == kFaceSlots;
  const Arc arc = groundOf(s, e.edge, c.face.overHole());
  const double deeper = all ? HUGE_VAL : height.min(arc) - deepestPoint(e) + beside(s);
  return std::min({leaves(s) - height.max(arc), ground, deeper});
}

void dropFace(Context& c, Evaluation& e) {
  if (!c.face.on) return;
  const ContactSlotMask points = facePoints(c.face);
  openPoints(points, c, e);
  c.face.on = false;
  c.face.crossings = 0;
  e.face = 0;
  e.open_set.valid &= ~points;
  e.closed_set.valid &= ~points;
}

bool beginFace(const System& s, Context& c, Evaluation& e) {
  if (c.face.on || !(e.closed & kFacePlaneSlot) || !nearlyLevel(e.edge)) return false;
  const bool over_hole = !hasGround(s, e.edge);
  if (over_hole && !reachesOver(s, e.edge)) return false;
  c.face.height = groundUnder(s, e.edge);
  const Round height = heights(c, e.edge);
  const std::size_t single = *Slots(kFacePlaneSlot);
  // a lowest point that has passed into the hole: the one at the start of the step
  const double lowest = e.valid(single) ? e.point(single).t : c.face.across + M_PI;
  if (hasSprings(s)) {
    // spring forces depend on the points, which are not moved
    if (std::max(height.at(lowest + kFaceTurn), height.at(lowest - kFaceTurn)) > kTouch)
      return false;
    const double depth = c.slots[single].depth;
    openPoints(kFaceSlots, c, e);
    c.face.on = true;
    setPoints(s, {lowest, lowest + kFaceTurn, lowest - kFaceTurn}, c, e);
    c.slots[0].depth = depth;
    e.contacts[0].gap = e.point(0).gap - depth;
    return true;
  }
  if (height.max(groundOf(s, e.edge, over_hole)) > 1.5 * contactHeight(s)) return false;
  c.face.crossings = over_hole ? kCrossingSlots : 0;
  openPoints(kFaceSlots, c, e);
  c.face.on = true;
  const Round speed = speeds(e);
  if (over_hole) {
    // the fastest approaching point, or the one that has carried
    const double falls = speed.minAt();
    const bool strikes =
        s.rigid && groundOf(s, e.edge, true).has(falls) && speed.min() < -kSettledSpeed;
    const double t = strikes ? falls : lowest;
    setPoints(s, {t, t, t}, c, e);
    return true;
  }
  // the point that has carried, the fastest approaching one, and a third away from both
  double fastest = std::remainder(speed.minAt() - lowest, 2.0 * M_PI);
  if (!(std::abs(fastest) > 0.5 * kFaceTurn)) fastest = kFaceTurn;
  setPoints(s, {lowest + 0.5 * fastest + M_PI, lowest, lowest + fastest}, c, e);
  return true;
}

bool updateFace(const System& s, Context& c, Evaluation& e) {
  if (!c.face.on) return false;
  const Round height = heights(c, e.edge);
  const Arc arc = groundOf(s, e.edge, c.face.overHole());
  const double up = hasSprings(s) ? highestPoint(e) : height.max(arc);
  if (up > 0.9 * leaves(s) || !(sameGround(s, c.face, e.edge) > 1e-12)) {
    endFace(s, c, e);
  } else if (!hasSprings(s) && (e.active() & kFaceSlots) != kFaceSlots &&
             height.min(arc) < deepestPoint(e) - 0.9 * beside(s)) {
    const std::size_t i = sparePoint(c.face.overHole() ? kFacePlaneSlot : kFaceSlots, c, e);
    if (i == kSlots) {
      // the plane point of a face over the hole carries, another point of its edge approaches
      if (c.face.overHole()) endFace(s, c, e);
      return false;
    }
    c.face.t[i] = height.minAt(arc);
    closePoints(s, 1u << i, c, e);
  } else {
    return false;
  }
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    if (e.contacts[i].gap_rate < -kSettledSpeed) return true;
  }
  return false;
}

void faceImpact(const System& s, Context& c, Evaluation& e) {
  for (int n = 0; n < kStrikes; ++n) {
    if (c.face.on && stopFace(s, c, e)) return;
    impact(s, c, e);
    if (!c.face.on) return endRocking(s, c, e);
    const Round speed = speeds(e);
    const Arc arc = groundOf(s, e.edge, c.face.overHole());
    if (speed.min(arc) >= -kSettledSpeed) return;
    const std::size_t i =
        c.face.overHole() ? slotOf(arc, speed.minAt()) : sparePoint(kFaceSlots, c, e);
    if (i == kSlots) return;
    if (c.face.overHole()) c.face.crossings |= kCrossingSlots & 1u << i;
    c.face.t[i] = speed.minAt(arc);
    closePoints(s, 1u << i, c, e);
  }
}

}  // namespace assembly_cell
