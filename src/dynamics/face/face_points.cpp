// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "face_points.h"

#include <optional>

#include "contact/contact_modes.h"
#include "contact/contact_solver.h"
#include "face_edge.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Distance of the centre of pressure from the axis over the radius above which the peg tips; above
// the rounding of forces.
constexpr double kInside = 1.0 - 1e-9;
// Three points with the centre of pressure as their centroid merge at the edge: limit of that
// distance, over the radius. 0.8 and 0.95: 10 scenes each of 181 level ones of test/stress, effort
// within 2 %.
constexpr double kSpread = 0.9;

// Demands of the material points of the edge, forces included: g'' + k g' + beta g [m/s²].
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

// Moves the three points; they keep the modes of the present ones.
void movePoints(const System& s, const std::array<double, 3>& t, Context& c, Evaluation& e) {
  Slot as;
  double maximum = -HUGE_VAL;
  for (const std::size_t i : Slots(e.active() & kFaceSlots)) {
    if (c.slots[i].mode == Mode::kIdle || !(e.contacts[i].normal_force > maximum)) continue;
    maximum = e.contacts[i].normal_force;
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

// Parameter of the plane point of a face over the hole with which it and the crossings at the arc's
// ends carry a load at the distance `out` (over the radius) in the direction `towards`: on the ray
// from the middle between the crossings through the load. For a load outside the face the tipping
// point; none if the peg tips about crossings.
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

// For a load near the arc: two points beside it and the farther crossing, as with both crossings
// each step would be limited by the distance of the load from the edge. False if the arc is too
// short.
bool pressNearEdge(const Arc& arc, double out, double towards, Face& face) {
  if (!(out > kSpread && out < kInside)) return false;
  const double side = std::remainder(towards - arc.about, 2.0 * M_PI);
  const double aside = std::acos(0.5 * (1.0 + out));
  if (std::abs(side) + aside > arc.half) return false;
  const std::size_t far = side > 0.0 ? 0 : 1;
  face.crossings = 1u << far;
  face.t[*Slots(kFacePlaneSlot)] = towards - aside;
  face.t[1 - far] = towards + aside;
  return true;
}

}  // namespace

void locateFace(const System& s, const Face& face, const EdgeCircle& edge, ContactSlotMask mask,
                ContactSet& set) {
  if (!(mask & kFaceSlots)) return;
  std::array<double, 3> t = face.t;
  if (face.overHole()) {
    const Arc arc = groundOf(s, edge, true);
    if (face.crossings & 1u) t[0] = arc.from();
    if (face.crossings & 2u) t[1] = arc.to();
  }
  for (const std::size_t i : Slots(mask & kFaceSlots)) {
    ContactPoint& point = set.slots[i];
    point.valid = true;
    point.feature = ContactFeature::kEdgePlane;
    point.t = t[i];
    point.cos_t = std::cos(point.t);
    point.sin_t = std::sin(point.t);
    point.p = edge.center + edge.radius * (point.cos_t * edge.axis0 + point.sin_t * edge.axis1);
    point.dp = edge.radius * (point.cos_t * edge.axis1 - point.sin_t * edge.axis0);
    point.rim = {face.height, point.p(1), point.p(2)};
    point.tangent.setZero();
    point.cross_norm = point.curvature = 0.0;
    point.normal = Eigen::Vector3d::UnitX();
    point.gap = point.p(0) - face.height;
  }
  set.valid |= mask & kFaceSlots;
}

void openPoints(ContactSlotMask points, Context& c, Evaluation& e) {
  for (const std::size_t i : Slots(points)) {
    setMode(i, Mode::kApart, c, e);
    c.slots[i] = {};
  }
}

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
  const Arc arc = groundOf(s, e.edge, c.face.overHole());
  std::optional<double> point;
  if (!lifted && c.face.overHole()) point = pointOverHole(arc, out, towards);
  if (lifted || (c.face.overHole() && !point)) {
    c.slots = decided;
    c.slope = contactForces(s, c.slots, Level::kEvents, e);
    return false;
  }
  if (point && pressNearEdge(arc, out, towards, c.face)) {
    movePoints(s, c.face.t, c, e);
  } else if (point) {
    tipAbout(s, *point, c, e);
  } else if (out < kInside) {
    // the centre of pressure is their centroid: each carries a third
    const double aside = std::acos(0.5 * (3.0 * std::min(out, kSpread) - 1.0));
    movePoints(s, {towards, towards + aside, towards - aside}, c, e);
  } else {
    tipAbout(s, towards, c, e);
  }
  return true;
}

std::size_t tippingSlot(const Context& c) {
  return c.face.overHole() ? *Slots(kFacePlaneSlot) : std::size_t{0};
}

void tipAbout(const System& s, double t, Context& c, Evaluation& e) {
  if (c.face.overHole()) {
    c.face.crossings = kCrossingSlots;
    return movePoints(s, {t, t, t}, c, e);
  }
  movePoints(s, {t, t + kFaceTurn, t - kFaceTurn}, c, e);
}

double tippingError(const System& s, double limit, const Context& c, const Evaluation& e) {
  const std::size_t tips = tippingSlot(c);
  if (!c.face.on || !(e.active() >> tips & 1u)) return 0.0;
  if (c.face.overHole() ? (e.active() & kFaceSlots) != kFaceSlots
                        : c.slots[tips].mode == Mode::kIdle) {
    return 0.0;
  }
  int others = 0;
  for (const std::size_t i : Slots(e.active() & kFaceSlots & ~(1u << tips))) {
    others += c.slots[i].mode == Mode::kIdle ? 0 : 1;
  }
  if (others > (c.face.overHole() ? 1 : 0)) return 0.0;
  const Round demand = demands(s, c, e);
  const Arc arc = groundOf(s, e.edge, c.face.overHole());
  if (demand.min(arc) > -limit) return 0.0;
  return std::remainder(demand.minAt(arc) - c.face.t[tips], 2.0 * M_PI);
}

}  // namespace assembly_cell
