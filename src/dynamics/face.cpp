// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "face.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "contact_modes.h"
#include "contact_solver.h"
#include "contact_tolerances.h"
#include "impact.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// How each was varied: in 181 level random scenes of test/stress; those with many impacts end
// elsewhere by any change.

// A face lies where its highest point is no farther over the plane: half of the tolerance, and at
// most half of what a closed contact may be, so that nobody can tell. Half and twice: 9 and 10
// scenes end elsewhere, effort +10 % and −2 %.
constexpr double kLies = 0.5, kMostLies = 5e-10;  // of the tolerance; [m]
// It has left so many times higher: between the two nothing changes. Half and twice: 15 and 17
// scenes, effort +5 % and +3 %.
constexpr double kLeft = 4.0;
// A peg that leans more is none that may lie: the band of chatter.h.
constexpr double kNearlyLevel = 1e-3;  // [rad]
// The edge is so far off the hole: twice the reach of its contacts, and a little. No result changes
// at half.
constexpr double kOffTheHole = 5e-5;  // [m]
// A pressure farther out, in radii, is one about which the peg tips; over the rounding of forces.
constexpr double kInside = 1.0 - 1e-9;
// Three points whose middle is the centre of pressure come together at the edge: up to here. 0.8
// and 0.95: 10 scenes each, effort within 2 %.
constexpr double kSpread = 0.9;
constexpr int kStrikes = 8;  // points of one impact that may come down one after the other
// A face that would rise by less than this part of what may lie is put to rest: the end of a peg
// that rocks, whose impacts else go on down to the rounding of a gap. Half and twice: 3 scenes.
constexpr double kLastRise = 1e-2;
// Of the cosine of the angle at which edge and rim cross: flatter is nearly a tangent.
constexpr double kCrosses = 0.99;
constexpr double kTurn = 2.0 * M_PI / 3.0;  // between points

bool hasSprings(const System& s) { return s.scenario.contact.law == ContactLaw::kSpringDashpot; }

// where contacts end at zero gap a face lies when it is in the ground
double lies(const System& s) {
  if (!s.discrete_friction) return 0.5 * kTouch;
  return s.fixed_step ? kMostLies : std::min(kMostLies, kLies * s.scenario.solver.tolerance);
}

double leaves(const System& s) { return kLeft * (s.discrete_friction ? lies(s) : kMostLies); }
double beside(const System& s) { return s.discrete_friction ? lies(s) : kMostLies; }

// What of the face's edge has ground under it: all, or the arc about a place, away from the hole.
struct Arc {
  double about = 0.0, half = M_PI;
  bool whole() const { return !(half < M_PI); }
  double from() const { return about - half; }
  double to() const { return about + half; }
  bool has(double t) const { return std::abs(std::remainder(t - about, 2.0 * M_PI)) <= half; }
};

// a quantity of the face's edge: its value at the place t is middle + cosine cos t + sine sin t
struct Round {
  double middle, cosine, sine;
  double at(double t) const { return middle + cosine * std::cos(t) + sine * std::sin(t); }
  double swing() const { return std::hypot(cosine, sine); }
  double least() const { return middle - swing(); }
  double leastAt() const { return std::atan2(-sine, -cosine); }
  double leastAt(const Arc& arc) const {
    const double t = leastAt();
    if (arc.has(t)) return t;
    return at(arc.from()) < at(arc.to()) ? arc.from() : arc.to();
  }
  double least(const Arc& arc) const { return arc.whole() ? least() : at(leastAt(arc)); }
  double most(const Arc& arc) const {
    if (arc.has(leastAt() + M_PI)) return middle + swing();
    return std::max(at(arc.from()), at(arc.to()));
  }
};

// height over the ground
Round heights(const Context& c, const EdgeCircle& edge) {
  return {edge.center(0) - c.face.height, edge.radius * edge.axis0(0), edge.radius * edge.axis1(0)};
}

// speed and acceleration upwards of the material points, forces included; as the law damps it
Round speeds(const Evaluation& e) {
  const EdgeCircle& edge = e.edge;
  const Vec3 middle = e.k.v + e.k.omega.cross(Vec3(edge.center - e.k.x));
  return {middle(0), edge.radius * e.k.omega.cross(edge.axis0)(0),
          edge.radius * e.k.omega.cross(edge.axis1)(0)};
}
Round demands(const System& s, const Context& c, const Evaluation& e) {
  const ContactParameters& law = s.scenario.contact;
  const Vec3 angular = e.k.Re * c.slope.segment<3>(3) + e.k.Re_rate * e.euler_rates;
  const auto turned = [&](const Vec3& r) {
    return (angular.cross(r) + e.k.omega.cross(e.k.omega.cross(r)))(0);
  };
  const EdgeCircle& edge = e.edge;
  Round found{c.slope(0) + turned(edge.center - e.k.x), edge.radius * turned(edge.axis0),
              edge.radius * turned(edge.axis1)};
  if (s.rigid) return found;
  const auto add = [&found](double factor, const Round& by) {
    found.middle += factor * by.middle;
    found.cosine += factor * by.cosine;
    found.sine += factor * by.sine;
  };
  add(law.rate, speeds(e));
  add(law.pull_back, heights(c, e.edge));
  return found;
}

double groundUnder(const System& s, const EdgeCircle& edge) {
  const double depth = s.shapes.hole_depth;
  return edge.center(0) < -0.5 * depth ? -depth : 0.0;
}

// how far the edge is from where the hole takes its ground away; the floor has all of it
double groundLeft(const System& s, const EdgeCircle& edge) {
  if (groundUnder(s, edge) < 0.0) return HUGE_VAL;
  const double rim = s.shapes.hole_radius + s.shapes.chamfer.width;
  return std::hypot(edge.center(1), edge.center(2)) - edge.radius - rim - kOffTheHole;
}

// Cosine of half the arc that reaches to where the edge crosses the rim; beyond ±1 it doesn't.
double crossing(const System& s, const EdgeCircle& edge) {
  const double rim = s.shapes.hole_radius + s.shapes.chamfer.width, r = edge.radius;
  const double off = std::hypot(edge.center(1), edge.center(2));
  return (rim * rim - off * off - r * r) / (2.0 * off * r);
}

// The face over the hole keeps to crossings that are no tangents, under the law whose points need
// no impacts.
bool reachesOver(const System& s, const EdgeCircle& edge) {
  return s.discrete_friction && !s.rigid && groundUnder(s, edge) == 0.0 &&
         std::abs(crossing(s, edge)) < kCrosses && (s.admitted & kFaceSlots) == kFaceSlots;
}

// of a face that reaches over the hole, or doesn't
Arc groundOf(const System& s, const EdgeCircle& edge, bool over_hole) {
  if (!over_hole) return {};
  const double away = std::atan2(edge.center(2), edge.center(1));
  const double y = std::sin(away), x = std::cos(away);
  return {std::atan2(x * edge.axis1(1) + y * edge.axis1(2), x * edge.axis0(1) + y * edge.axis0(2)),
          std::acos(std::clamp(crossing(s, edge), -1.0, 1.0))};
}

bool nearlyLevel(const EdgeCircle& edge) {
  const double tilt2 = edge.axis0(0) * edge.axis0(0) + edge.axis1(0) * edge.axis1(0);
  return tilt2 < kNearlyLevel * kNearlyLevel;
}

// How far the edge is from where the ground under it becomes another.
double sameGround(const System& s, const Face& face, const EdgeCircle& edge) {
  if (!face.over_hole) return groundLeft(s, edge);
  return edge.radius * (kCrosses - std::abs(crossing(s, edge)));
}

// the closed point that is deepest; 0 where none is closed
double deepestPoint(const Evaluation& e) {
  double deepest = 0.0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    deepest = std::min(deepest, e.point(i).gap);
  }
  return deepest;
}

// the point that is highest over where its spring begins
double highestPoint(const Evaluation& e) {
  double highest = -HUGE_VAL;
  for (const std::size_t i : Slots(kFaceSlots)) highest = std::max(highest, e.contacts[i].gap);
  return highest;
}

void openPoints(ContactSlotMask points, Context& c, Evaluation& e) {
  for (const std::size_t i : Slots(points)) {
    setMode(i, Mode::kApart, c, e);
    c.slots[i] = {};
  }
}

// contact points of these slots, found anew while they are open; closed
void closePoints(const System& s, ContactSlotMask points, Context& c, Evaluation& e) {
  openPoints(points, c, e);
  locate(s, c, s.admitted & ~e.closed, e, e.open_set);
  for (const std::size_t i : Slots(points)) {
    setMode(i, Mode::kIdle, c, e);
    if (s.scenario.contact.law != ContactLaw::kViscous) keepDepth(i, 0.0, c, e);
  }
}

void setPoints(const System& s, const std::array<double, 3>& t, Context& c, Evaluation& e) {
  c.face.t = t;
  closePoints(s, facePoints(c.face), c, e);
}

// new points that go on as those do that carry the face
void movePoints(const System& s, const std::array<double, 3>& t, Context& c, Evaluation& e) {
  Slot as;
  double most = -HUGE_VAL;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    if (c.slots[i].mode == Mode::kIdle || !(e.contacts[i].normal_force > most)) continue;
    most = e.contacts[i].normal_force;
    as = c.slots[i];
  }
  setPoints(s, t, c, e);
  if (as.mode == Mode::kApart) return;
  for (const std::size_t i : Slots(facePoints(c.face))) {
    c.slots[i].mode = as.mode;
    c.slots[i].armed = as.armed;
    c.slots[i].slip_direction = as.slip_direction;
  }
}

// back to the lowest point of the edge; a spring goes on as the one that is pressed most
void endFace(const System& s, Context& c, Evaluation& e) {
  const bool touched = (e.active() & kFaceSlots) != 0;
  double pressed = 0.0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    if (hasSprings(s)) pressed = std::min(pressed, e.contacts[i].gap);
  }
  dropFace(c, e);
  locate(s, c, s.admitted & ~e.closed, e, e.open_set);
  for (const std::size_t i : Slots(e.open_set.valid & kFacePlaneSlot)) {
    if (!touched || e.contacts[i].gap > s.leave_gap) continue;
    setMode(i, Mode::kIdle, c, e);
    if (s.scenario.contact.law != ContactLaw::kViscous) keepDepth(i, pressed, c, e);
  }
}

// a slot whose point carries nothing; kSlots where all do
std::size_t sparePoint(const Context& c, const Evaluation& e) {
  std::size_t spare = kSlots;
  for (const std::size_t i : Slots(facePoints(c.face))) {
    if (c.slots[i].mode == Mode::kApart) return i;
    if (c.slots[i].mode == Mode::kIdle || e.contacts[i].force.isZero()) spare = i;
  }
  return spare;
}

// What is left of rocking would not lift the face: all of it is stopped, without friction.
bool putToRest(const System& s, Context& c, Evaluation& e) {
  const Round height = heights(c, e.edge), speed = speeds(e);
  if (height.middle + height.swing() > lies(s)) return false;
  const double fastest = std::abs(speed.middle) + speed.swing();
  if (fastest * fastest > 2.0 * kLastRise * lies(s) * freeAcceleration(s, e)) return false;
  closePoints(s, kFaceSlots & ~e.active(), c, e);
  Constraints rows;
  for (const std::size_t i : Slots(kFaceSlots)) {
    const Vec3& normal = e.point(i).normal;
    rows.add(i, e.contacts[i].r, normal).change = -e.contacts[i].gap_rate * normal;
  }
  rows.tellFace(e.material);
  solveConstraints(bodyOf(s, e.k), rows);
  applyImpulse(s, rows.total(), c, e);
  return true;
}

// Where the point of a face over the hole has to be that the crossings at the arc's ends and itself
// carry a load so far out, in radii, towards a place: beyond it on the ray from the middle between
// the crossings. Outside the face the place towards which the peg tips; nothing where it tips about
// crossings.
std::optional<double> pointOverHole(const Arc& arc, double out, double towards) {
  const double side = std::remainder(towards - arc.about, 2.0 * M_PI), chord = std::cos(arc.half);
  if (out * std::cos(side) <= chord) return {};
  if (out >= kInside) return std::abs(side) < arc.half ? std::optional(towards) : std::nullopt;
  const Eigen::Vector2d middle(chord, 0.0);
  const Eigen::Vector2d ray = out * Eigen::Vector2d(std::cos(side), std::sin(side)) - middle;
  const double along = middle.dot(ray), square = ray.squaredNorm();
  const double way = (std::sqrt(along * along + square * (1.0 - chord * chord)) - along) / square;
  const Eigen::Vector2d at = middle + way * ray;
  return arc.about + std::atan2(at.y(), at.x());
}

}  // namespace

bool hasGround(const System& s, const EdgeCircle& edge) {
  return !(s.excluded & kFacePlaneSlot) && nearlyLevel(edge) && groundLeft(s, edge) > 0.0;
}

void beginFaceStep(Context& c, const Evaluation& e) {
  for (const std::size_t i : Slots(e.active() & kFacePlaneSlot)) {
    c.face.across = e.point(i).t + M_PI;
  }
}

double faceEvent(const System& s, const Context& c, const Evaluation& e) {
  const Round height = heights(c, e.edge);
  if (!c.face.on) {
    // the point across from the one that carried at the step's start: it stays down once it is
    if (!(e.active() & kFacePlaneSlot) || !nearlyLevel(e.edge)) return HUGE_VAL;
    const double up = height.middle + c.face.height - groundUnder(s, e.edge);
    const Round over{up, height.cosine, height.sine};
    if (!hasGround(s, e.edge)) {
      if (!reachesOver(s, e.edge)) return HUGE_VAL;
      return over.most(groundOf(s, e.edge, true)) - lies(s);
    }
    // of springs two points beside it, which carry nothing then
    const double t = c.face.across;
    return hasSprings(s) ? std::max(over.at(t + 0.5 * kTurn), over.at(t - 0.5 * kTurn))
                         : over.at(t) - lies(s);
  }
  const double ground = sameGround(s, c.face, e.edge);
  if (hasSprings(s)) return std::min(ground, leaves(s) - highestPoint(e));
  const bool all = (e.active() & kFaceSlots) == kFaceSlots;
  const Arc arc = groundOf(s, e.edge, c.face.over_hole);
  const double deeper = all ? HUGE_VAL : height.least(arc) - deepestPoint(e) + beside(s);
  return std::min({leaves(s) - height.most(arc), ground, deeper});
}

void dropFace(Context& c, Evaluation& e) {
  if (!c.face.on) return;
  const ContactSlotMask points = facePoints(c.face);
  openPoints(points, c, e);
  c.face.on = c.face.over_hole = false;
  e.face = e.material = 0;
  e.open_set.valid &= ~points;
  e.closed_set.valid &= ~points;
}

bool beginFace(const System& s, Context& c, Evaluation& e) {
  if (c.face.on || !(e.active() & kFacePlaneSlot) || !nearlyLevel(e.edge)) return false;
  const bool over_hole = !hasGround(s, e.edge);
  if (over_hole && !reachesOver(s, e.edge)) return false;
  c.face.height = groundUnder(s, e.edge);
  const Round height = heights(c, e.edge);
  const std::size_t single = *Slots(kFacePlaneSlot);
  const double lowest = e.point(single).t;
  if (hasSprings(s)) {
    // their forces depend on the points, which stay where they are
    if (std::max(height.at(lowest + kTurn), height.at(lowest - kTurn)) > kTouch) return false;
    const double depth = c.slots[single].depth;
    openPoints(kFaceSlots, c, e);
    c.face.on = true;
    setPoints(s, {lowest, lowest + kTurn, lowest - kTurn}, c, e);
    c.slots[0].depth = depth;
    e.contacts[0].gap = e.point(0).gap - depth;
    return true;
  }
  if (height.most(groundOf(s, e.edge, over_hole)) > 1.5 * lies(s)) return false;
  c.face.over_hole = over_hole;
  if (over_hole) {
    openPoints(kFacePlaneSlot, c, e);
    c.face.on = true;
    setPoints(s, {lowest, lowest, lowest}, c, e);
    return true;
  }
  openPoints(kFaceSlots, c, e);
  c.face.on = true;
  // the point that has carried, the one that comes down fastest, and one beside both
  double fastest = std::remainder(speeds(e).leastAt() - lowest, 2.0 * M_PI);
  if (!(std::abs(fastest) > 0.5 * kTurn)) fastest = kTurn;
  setPoints(s, {lowest + 0.5 * fastest + M_PI, lowest, lowest + fastest}, c, e);
  return true;
}

bool updateFace(const System& s, Context& c, Evaluation& e) {
  if (!c.face.on) return false;
  const Round height = heights(c, e.edge);
  const Arc arc = groundOf(s, e.edge, c.face.over_hole);
  const double up = hasSprings(s) ? highestPoint(e) : height.most(arc);
  if (up > 0.9 * leaves(s) || !(sameGround(s, c.face, e.edge) > 1e-12)) {
    endFace(s, c, e);
  } else if (!hasSprings(s) && (e.active() & kFaceSlots) != kFaceSlots &&
             height.least(arc) < deepestPoint(e) - 0.9 * beside(s)) {
    const std::size_t i = sparePoint(c, e);
    if (i == kSlots) {
      // the one point of a face over the hole carries, another place of its edge comes down
      if (c.face.over_hole) endFace(s, c, e);
      return false;
    }
    c.face.t[i] = height.leastAt(arc);
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
    if (c.face.on && putToRest(s, c, e)) return;
    impact(s, c, e);
    if (!c.face.on) return;
    const Round speed = speeds(e);
    const std::size_t i = sparePoint(c, e);
    if (speed.least() >= -kSettledSpeed || i == kSlots) return;
    c.face.t[i] = speed.leastAt();
    closePoints(s, 1u << i, c, e);
  }
}

bool moveFacePoints(const System& s, double limit, Context& c, Evaluation& e) {
  if (hasSprings(s) || (e.active() & kFaceSlots) != kFaceSlots) return false;
  const SlotArray decided = c.slots;
  bool idle = false;
  std::size_t going = kSlots;
  for (const std::size_t i : Slots(kFaceSlots)) {
    Slot& slot = c.slots[i];
    const bool pulled = e.contacts[i].normal_force < -limit * s.scenario.mechanism.peg.mass;
    idle = idle || pulled || slot.mode == Mode::kIdle;
    if (slot.mode != Mode::kIdle) going = i;
  }
  if (!idle) return false;
  for (const std::size_t i : Slots(kFaceSlots)) {
    Slot& slot = c.slots[i];
    if (slot.mode != Mode::kIdle) continue;
    slot.mode = slot.armed || !s.discrete_friction ? Mode::kSlip : Mode::kStick;
    if (going < kSlots && !slot.armed) slot = c.slots[going];
  }
  contactForces(s, c.slots, Level::kForces, e);
  double load = 0.0;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const std::size_t i : Slots(kFaceSlots)) {
    const double N = e.contacts[i].normal_force;
    load += N;
    middle += N * Eigen::Vector2d(e.point(i).cos_t, e.point(i).sin_t);
  }
  const double out = middle.norm() / load;
  const double towards = std::atan2(middle(1), middle(0));
  const bool lifted = !(load > limit * s.scenario.mechanism.peg.mass);
  std::optional<double> point;
  if (!lifted && c.face.over_hole) {
    point = pointOverHole(groundOf(s, e.edge, true), out, towards);
  }
  if (lifted || (c.face.over_hole && !point)) {
    c.slots = decided;
    c.slope = contactForces(s, c.slots, Level::kEvents, e);
    return false;
  }
  if (point) {
    tipAbout(s, *point, c, e);
  } else if (out < kInside) {
    // their middle is the centre of pressure: each carries a third
    const double aside = std::acos(0.5 * (3.0 * std::min(out, kSpread) - 1.0));
    movePoints(s, {towards, towards + aside, towards - aside}, c, e);
  } else {
    tipAbout(s, towards, c, e);
  }
  return true;
}

std::size_t tippingSlot(const Context& c) {
  return c.face.over_hole ? *Slots(kFacePlaneSlot) : std::size_t{0};
}

void tipAbout(const System& s, double t, Context& c, Evaluation& e) {
  if (c.face.over_hole) return movePoints(s, {t, t, t}, c, e);
  movePoints(s, {t, t + kTurn, t - kTurn}, c, e);
}

double tippingError(const System& s, double limit, const Context& c, const Evaluation& e) {
  const std::size_t tips = tippingSlot(c);
  if (!c.face.on || !(e.active() >> tips & 1u) || c.slots[tips].mode == Mode::kIdle) return 0.0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots & ~(1u << tips))) {
    if (c.slots[i].mode != Mode::kIdle) return 0.0;
  }
  const Round demand = demands(s, c, e);
  const Arc arc = groundOf(s, e.edge, c.face.over_hole);
  if (demand.least(arc) > -limit) return 0.0;
  return std::remainder(demand.leastAt(arc) - c.face.t[tips], 2.0 * M_PI);
}

}  // namespace assembly_cell
