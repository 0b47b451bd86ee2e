// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The peg's edge against rim, plane, floor and wall.
#include <algorithm>
#include <limits>

#include "contact_search.h"

namespace assembly_cell {
namespace contact_search {
namespace {

// Samples of half a circle. Half and twice: other contacts in 24 and 8 of 360 000 random searches.
constexpr int kScanPoints = 48;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

void meridian(const Peg& e, const Place& at, Meridian& m) {
  edgePoint(e, at, m);
  m.rho = levelNorm(m.x);
  m.inverse_rho = m.rho > 0.0 ? 1.0 / m.rho : 0.0;
  m.drho = levelDot(m.x, m.dx) * m.inverse_rho;
  m.ddrho = (levelDot(m.dx, m.dx) - levelDot(m.x, m.u) - m.drho * m.drho) * m.inverse_rho;
}

// Meridian of a point moved back by `step`, from the one before.
void turnBack(const Peg& e, double step, Meridian& m) {
  const auto [cosine, sine] = turnOf(step);
  const Vec3 u = combined(cosine, m.u, -sine, m.dx);
  m.dx = combined(cosine, m.dx, sine, m.u);
  m.u = Vec3(u);
  m.x = combined(1.0, e.center, 1.0, m.u);
}

// Slot 0: the edge leaves the hole with rising t, outwards and up; slot 1: it returns. Of an
// inclined bore relative to its wall.
bool admissible(const Peg& e, const Meridian& m, int slot) {
  const double drho = e.leans() ? m.drho - levelDot(e.lean, m.x) * m.inverse_rho * m.dx(0) : m.drho;
  return slot == 0 ? drho >= 0.0 && m.dx(0) >= 0.0 : drho <= 0.0 && m.dx(0) <= 0.0;
}

// Solves Phi(t) = x1 x1' + (rho − r_h) rho' = 0 for a local minimum of the distance to the rim.
// kNone: of the other slot, or a distance above `far`.
Search searchRim(const Peg& e, double r_h, double far, int slot, Place& at, Meridian& m) {
  for (int i = 0; i < kNewtonLimit; ++i) {
    meridian(e, at, m);
    const double out = m.rho - r_h;
    const double x = m.x(0), dx = m.dx(0), u = m.u(0);
    const double value = x * dx + out * m.drho;
    const double slope = dx * dx - x * u + m.drho * m.drho + out * m.ddrho;
    if (!(slope > 0.0)) return Search::kFailed;
    bool last = false;
    const double step = halley(value, slope, 1.5 * (m.drho * m.ddrho - dx * u), last);
    if (!(std::abs(step) < 0.5)) return Search::kFailed;
    if (last) {
      turnBack(e, step, m);
      at = stepBack(at, step);
      // 1/rho by one Newton step from the last one, whose error is of the order of `step`
      const double rho2 = levelDot(m.x, m.x);
      m.inverse_rho += step * m.drho * m.inverse_rho * m.inverse_rho;
      m.inverse_rho *= 1.5 - 0.5 * rho2 * m.inverse_rho * m.inverse_rho;
      m.rho = rho2 * m.inverse_rho;
      m.drho = levelDot(m.x, m.dx) * m.inverse_rho;
      return admissible(e, m, slot) ? Search::kFound : Search::kNone;
    }
    at = stepBack(at, step);
    const bool above = x > 0.0 && out < 0.0 && std::abs(step) < 0.1;
    if (above && x * x + out * out - value * step > far * far) return Search::kNone;
  }
  return Search::kFailed;
}

// Cold start; reach: crossings higher above the plane may be omitted [m].
Search searchRimCold(const Peg& e, double r_h, double reach, int slot, Place& at, Meridian& m) {
  // crossing of an upright edge with the hole's cylinder
  const double side = slot == 0 ? 1.0 : -1.0;
  const double c =
      std::clamp((r_h * r_h - e.r * e.r - e.offset * e.offset) / (2 * e.r * e.offset), -1.0, 1.0);
  const double s = std::sqrt(1.0 - c * c);
  Place out{};
  if (!e.placeOfOffset(out)) return Search::kNone;
  const Place crossing{c * out.c + side * s * out.s, c * out.s - side * s * out.c, 0.0};

  // no contact if the crossing is well above the plane. Tilt moves it by at most the shift, as the
  // projected ellipse is narrower than the circle by r (1 − cos tilt). The gap is the height times
  // the slope of the normal, at least height / (1 + A/slope)
  const double slope = e.offset * s;
  const double shift = e.amplitude * e.sine;
  const double height = e.center(0) + crossing.c * e.p(0) + crossing.s * e.q(0) - reach;
  if (shift < 0.3 * slope && height * slope > e.amplitude * (2 * shift + reach))
    return Search::kNone;

  const auto from = [&](const Place& start, double far) {
    at = start;
    const Search search = searchRim(e, r_h, far, slot, at, m);
    if (search == Search::kFound) at.t = std::atan2(at.s, at.c);
    return search;
  };
  const Search search = from(crossing, kKept * reach);
  if (search == Search::kFound || !(e.amplitude > 0.0)) return search;
  // second start: crossing of the edge with the plane
  const double cp = std::clamp(e.center(0) / e.amplitude, -1.0, 1.0),
               sp = side * std::sqrt(1 - cp * cp);
  const Place level{e.lc * cp - e.ls * sp, e.ls * cp + e.lc * sp, 0.0};
  const Search second = from(level, kKept * reach);
  if (second != Search::kFailed) return second;
  if (search != Search::kFailed) return search;

  // third start: the nearest admissible point among samples of the half circle
  double best = kInfinity;
  const double turn = -side * M_PI / kScanPoints;
  Place sample = stepBack({e.lc, e.ls, 0.0}, 0.5 * turn), start{};
  for (int i = 0; i < kScanPoints; ++i) {
    meridian(e, sample, m);
    const double distance = m.x(0) * m.x(0) + square(m.rho - r_h);
    if (distance < best && admissible(e, m, slot)) {
      best = distance;
      start = sample;
    }
    sample = stepBack(sample, turn);
  }
  if (!(best < kInfinity)) return Search::kNone;
  return from(start, kInfinity);
}

// The normal is outside the normal cone of the hole's chamfer edge: at the lower edge the peg's
// edge is less steep than the cone, at the upper one steeper.
bool beyondCone(const Peg& e, const Rim& rim, const Meridian& m, int slot) {
  const double out = slot == 0 ? m.drho : -m.drho;
  const double lean = levelDot(e.lean, m.x) * m.inverse_rho;
  const double flat =
      rim.cone->cosine * (out - lean * std::abs(m.dx(0))) - rim.cone->sine * std::abs(m.dx(0));
  return rim.lower ? flat > 0.0 : flat < 0.0;
}

// The normal is outside the normal cone of the edge of the peg's chamfer.
bool beyondPegCone(const Peg& e, const Vec3& normal, const Vec3& out) {
  const double flat = e.cone->cosine * normal.dot(e.axis) + e.cone->sine * normal.dot(out) / e.r;
  return e.shoulder ? flat > 0.0 : flat < 0.0;
}

// A maximum of rho is a contact with the wall: below the rim, and the penetration of plane
// (chamfer) is not smaller.
bool acceptWall(const Peg& e, const Rim& rim, double far, Meridian& m) {
  if (!(m.x(0) <= kTouch * e.r)) return false;
  m.rho = levelNorm(m.x);
  m.inverse_rho = 1.0 / m.rho;
  const double depth = m.rho - rim.radius;
  if (!(-depth <= far)) return false;
  if ((!rim.cone && depth <= -m.x(0)) || depth <= 0.0) return true;
  // the edge leaves the wall at ±sqrt(2 depth/|rho''|); maximum depth within
  m.ddrho *= m.inverse_rho;
  m.drho = 0.0;
  const Depth above = rim.cone ? coneDepth(rim, m) : planeDepth(m);
  return depth <= above.max(-2 * depth / m.ddrho);
}

}  // namespace

void edgeEdge(const Peg& e, const Rim& rim, double reach, int slot, bool warm,
              ContactPoint& contact) {
  const double r_h = rim.radius;
  Place at{contact.cos_t, contact.sin_t, contact.t};
  contact.valid = false;
  // the edge is inside or outside the hole's cylinder: no crossing, no contact
  if (e.offset + e.r <= r_h || e.offset >= e.r + r_h || e.offset < kNoOffset) return;
  // nor if all of it is deeper than its maximum lateral overlap
  if (e.center(0) + e.amplitude < -(e.offset + e.r - r_h)) return;

  Meridian m;
  Search search = warm ? searchRim(e, r_h, kInfinity, slot, at, m) : Search::kFailed;
  if (search != Search::kFound) search = searchRimCold(e, r_h, reach, slot, at, m);
  if (search != Search::kFound) return;
  const double norm = std::sqrt(m.dx(0) * m.dx(0) + m.drho * m.drho);
  if (!(norm > kParallel * e.r)) return;

  // normal up and towards the axis, and in the normal cone of the peg's edge
  const double inverse = 1.0 / norm;
  // a normal pointing down exists only at an overhanging wall
  const double out_rate = e.leans() && slot == 1 ? -m.drho : m.drho;
  const double up = (e.leans() ? out_rate : std::abs(m.drho)) * inverse;
  const double inward = std::abs(m.dx(0)) * inverse;
  const double e2 = m.x(1) * m.inverse_rho, e3 = m.x(2) * m.inverse_rho;
  const Vec3 normal(up, -inward * e2, -inward * e3);
  if (normal.dot(e.axis) < 0.0 || normal.dot(m.u) > 0.0) return;
  if (e.cone && beyondPegCone(e, normal, m.u)) return;
  // deeper than the maximum lateral overlap with wall or chamfer: not a contact of the rim
  const double out = m.rho - r_h, gap = up * m.x(0) - inward * out;
  if (rim.cone && beyondCone(e, rim, m, slot)) return;
  if (rim.cone && gap < 0.0 && coneDepth(rim, m).turnsAbove(-gap)) return;
  const bool at_wall = !rim.cone || rim.lower;
  if (at_wall && gap < 0.0 && m.ddrho < 0.0 && m.drho * m.drho < 2 * m.ddrho * (out + gap)) return;
  setEdge(ContactFeature::kEdgeEdge, at, m, contact);
  contact.rim = {0.0, r_h * e2, r_h * e3};
  contact.tangent = {0.0, -r_h * e3, r_h * e2};
  contact.normal = Vec3(normal);
  contact.cross_norm = (slot == 0 ? -r_h : r_h) * norm;
  contact.gap = gap;
}

void edgePlane(const Peg& e, const Rim& rim, double hole_depth, double far, ContactPoint& contact) {
  contact.valid = false;
  const double lowest = e.center(0) - e.amplitude;
  const bool floor = lowest <= far - hole_depth;
  if (!(lowest <= far)) return;
  Place at{e.lc, e.ls, 0.0};
  // parallel to the plane: the edge point farthest from the hole's axis represents the face
  if (!e.tilted()) {
    const bool directed = e.offset >= kNoOffset && e.placeOfOffset(at);
    if (!directed && !floor) return;
  }
  Meridian m;
  edgePoint(e, at, m);
  const double rho2 = levelDot(m.x, m.x), r_h = rim.radius;
  const bool outside = rho2 > r_h * r_h;
  if (!outside && !floor) return;
  double height = outside ? 0.0 : -hole_depth;
  if (outside && lowest < 0.0 && (rim.cone || square(r_h - lowest) > rho2)) {
    // deeper than the maximum lateral overlap with wall or chamfer: in the hole
    meridian(e, at, m);
    const double sideways = lowest + m.rho - r_h;
    if (rim.cone ? coneDepth(rim, m).turnsAbove(-lowest)
                 : m.ddrho < 0.0 && m.drho * m.drho < 2 * m.ddrho * sideways) {
      if (!floor) return;
      height = -hole_depth;
    }
  }
  at.t = std::atan2(at.s, at.c);
  setEdge(ContactFeature::kEdgePlane, at, m, contact);
  contact.rim = {height, m.x(1), m.x(2)};
  contact.normal = {1.0, 0.0, 0.0};
  contact.gap = lowest - height;
  leanBack(e, contact);
}

void edgeWall(const Peg& e, const Rim& rim, double far, std::size_t first, ContactSlotMask admitted,
              ContactSet& set) {
  SlotPair pair(set, admitted, first);
  const double r_h = rim.radius;
  const double lean = e.leans() ? levelNorm(e.lean) : 0.0;
  if (e.offset + e.r + lean * e.amplitude < r_h - far) return;
  const double bend = e.amplitude * (e.sine + 2 * lean);
  if (!(e.offset > kCoaxial * e.r) && !(bend > kCoaxial * e.r)) return;
  // a single maximum, near the direction of the offset: skipped if the penetration of the plane
  // (chamfer) is smaller, or above it
  const bool single = e.offset * e.axis(0) > bend;
  if (!pair.warm && !e.leans() && e.offset > 2 * bend) {
    const double out = e.offset + e.r * e.axis(0) - r_h, under = e.amplitude - e.center(0);
    if (rim.cone ? (1.0 - rim.cone->cosine) * out > rim.cone->sine * under : out > under) return;
    Place towards{};
    if (!e.placeOfOffset(towards)) return;
    const double height = e.center(0) + towards.c * e.p(0) + towards.s * e.q(0);
    if (height * e.offset > 2 * e.amplitude * bend + kTouch * e.r * e.offset) return;
  }

  Meridian m;
  Extremum extremum{};
  // derivatives of rho²/2, with p' · (p − centre) = 0 and |p'| = |p − centre|: no cancellation near
  // the axis
  const auto evaluate = [&](const Place& at) {
    edgePoint(e, at, m);
    if (e.leans()) {
      return Extremum{levelDot(m.x, m.dx), levelDot(m.dx, m.dx) - levelDot(m.x, m.u),
                      -1.5 * levelDot(m.dx, m.u) - 0.5 * levelDot(m.x, m.dx), levelDot(m.x, m.x)};
    }
    const double u = m.u(0), dx = m.dx(0);
    const double along = levelDot(e.center, m.dx);
    return Extremum{along - u * dx, u * u - dx * dx - levelDot(e.center, m.u),
                    2 * u * dx - 0.5 * along, levelDot(m.x, m.x)};
  };
  const double limit2 = square(std::max(r_h - far, 0.0));
  const auto find = [&](Place& at) {
    if (searchExtremum(evaluate, -1.0, limit2, at, extremum) != Search::kFound) return false;
    m.ddrho = extremum.slope;
    return acceptWall(e, rim, far, m);
  };
  const auto start = [&](bool farther, Place& at) {
    // the projected minor axis, of length cos(tilt), is along `low`
    const Vec3 low = (e.lc * e.p + e.ls * e.q) / e.r, major = (e.lc * e.q - e.ls * e.p) / e.r;
    const Ellipse seen{e.r, e.sine, 1.0, levelDot(major, e.center), -levelDot(low, e.center)};
    if (!seen.start((seen.x >= 0.0) == farther ? 1.0 : -1.0, false, at)) return false;
    // from the axes of the ellipse (major, −low) to t
    at = placeOf(-at.c * e.ls - at.s * e.lc, at.c * e.lc - at.s * e.ls);
    return true;
  };
  fillPair(pair, single, find, start, [&](const Place& at, ContactPoint& contact) {
    const double e2 = m.x(1) * m.inverse_rho, e3 = m.x(2) * m.inverse_rho;
    setEdge(ContactFeature::kEdgeWall, at, m, contact);
    contact.rim = {m.x(0), r_h * e2, r_h * e3};
    contact.normal = {0.0, -e2, -e3};
    contact.tangent = {0.0, e3, -e2};
    contact.gap = r_h - m.rho;
    contact.curvature = m.inverse_rho;
    if (e.leans()) leanWall(e, levelDot(e.lean, m.x) * m.inverse_rho, contact);
  });
}

}  // namespace contact_search
}  // namespace assembly_cell
