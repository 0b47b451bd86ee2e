// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/contact_geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kNewtonLimit = 12;
constexpr int kScanPoints = 48;
// below this |T × p'| / (r_h r_p) the tangents count as parallel and there is no candidate
constexpr double kParallel = 1e-6;
// lengths of these parts of the peg's radius: tilts (sine) and offsets that have no direction, and
// rounding of a height at a hand-over
constexpr double kLevel = 1e-12, kCoaxial = 1e-13, kTouch = 1e-12;
// candidates of one kind nearer than this (angle, chord over radius) are one
constexpr double kMerged = 1e-6;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double square(double x) { return x * x; }

// a place on a circle, kept as cosine and sine so that Newton steps need no trigonometry
struct Place {
  double c, s, t;
};

// turns a place back by `step`, normalised anew
Place stepBack(const Place& at, double step) {
  double cosine, sine;
  if (std::abs(step) < 0.02) {
    const double d = step * step;
    cosine = 1.0 - d / 2 * (1.0 - d / 12 * (1.0 - d / 30));
    sine = step * (1.0 - d / 6 * (1.0 - d / 20 * (1.0 - d / 42)));
  } else {
    cosine = std::cos(step);
    sine = std::sin(step);
  }
  const double c = at.c * cosine + at.s * sine, s = at.s * cosine - at.c * sine;
  const double scale = 1.5 - 0.5 * (c * c + s * s);
  return {c * scale, s * scale, at.t - step};
}

Place placeOf(double c, double s) { return {c, s, std::atan2(s, c)}; }

// place in the direction (x, y); false where that is none
bool placeTowards(double x, double y, Place& at) {
  const double norm = std::sqrt(x * x + y * y);
  if (!(norm > 0.0)) return false;
  const double inverse = 1.0 / norm;
  at.c = x * inverse;
  at.s = y * inverse;
  return true;
}

// the peg as the searches want it: scaled axes of the edge, its axis, tilt and offset
struct Peg {
  double r;
  double c1, c2, c3;              // bottom centre
  double p1, p2, p3, q1, q2, q3;  // r R0, r R1
  double a1, a2, a3;
  double amplitude;     // A = r sin(tilt)
  double sine, offset;  // of the tilt; of the centre from the hole's axis
  double lc, ls;        // t of the lowest point; of t = 0 for an upright peg

  explicit Peg(const EdgeCircle& e)
      : r(e.radius),
        c1(e.center(0)),
        c2(e.center(1)),
        c3(e.center(2)),
        p1(r * e.axis0(0)),
        p2(r * e.axis0(1)),
        p3(r * e.axis0(2)),
        q1(r * e.axis1(0)),
        q2(r * e.axis1(1)),
        q3(r * e.axis1(2)),
        a1(e.axis0(1) * e.axis1(2) - e.axis0(2) * e.axis1(1)),
        a2(e.axis0(2) * e.axis1(0) - e.axis0(0) * e.axis1(2)),
        a3(e.axis0(0) * e.axis1(1) - e.axis0(1) * e.axis1(0)),
        amplitude(std::sqrt(p1 * p1 + q1 * q1)),
        sine(amplitude / r),
        offset(std::sqrt(c2 * c2 + c3 * c3)) {
    const bool level = !(sine > kLevel);
    const double inverse = level ? 0.0 : 1.0 / amplitude;
    lc = level ? 1.0 : -p1 * inverse;
    ls = -q1 * inverse;
  }

  bool finite() const { return std::isfinite(c1 + offset + amplitude + a1 + a2 + a3); }
};

// ---- the peg's edge against the rim

// the meridian curve (x1, rho) of the edge and its derivatives by t
struct Meridian {
  double x1, x2, x3, dx1, dx2, dx3, u1, u2, u3;  // p, p', p − centre
  double rho, inverse_rho, drho, ddrho;
};

void edgePoint(const Peg& e, const Place& at, Meridian& m) {
  m.u1 = at.c * e.p1 + at.s * e.q1;
  m.u2 = at.c * e.p2 + at.s * e.q2;
  m.u3 = at.c * e.p3 + at.s * e.q3;
  m.dx1 = at.c * e.q1 - at.s * e.p1;
  m.dx2 = at.c * e.q2 - at.s * e.p2;
  m.dx3 = at.c * e.q3 - at.s * e.p3;
  m.x1 = e.c1 + m.u1;
  m.x2 = e.c2 + m.u2;
  m.x3 = e.c3 + m.u3;
}

void meridian(const Peg& e, const Place& at, Meridian& m) {
  edgePoint(e, at, m);
  m.rho = std::sqrt(m.x2 * m.x2 + m.x3 * m.x3);
  m.inverse_rho = m.rho > 0.0 ? 1.0 / m.rho : 0.0;
  m.drho = (m.x2 * m.dx2 + m.x3 * m.dx3) * m.inverse_rho;
  m.ddrho = (m.dx2 * m.dx2 + m.dx3 * m.dx3 - (m.x2 * m.u2 + m.x3 * m.u3) - m.drho * m.drho) *
            m.inverse_rho;
}

// slot 0 leaves the hole with rising t; in both the edge climbs outwards
bool admissible(const Meridian& m, int slot) {
  return slot == 0 ? m.drho >= 0.0 && m.dx1 >= 0.0 : m.drho <= 0.0 && m.dx1 <= 0.0;
}

enum class Search { kFound, kNone, kFailed };

// Halley's step for the root of a function with this value, slope and half second derivative:
// Newton's step, and what the parabola adds; `last`: cubic convergence leaves only rounding
double halley(double value, double slope, double half_bend, bool& last) {
  const double inverse = 1.0 / slope, step = value * inverse, bend = half_bend * inverse * step;
  last = std::abs(step) < 1e-4 && bend * bend * std::abs(step) < 1e-15;
  return std::abs(bend) < 0.25 ? step * (1.0 + bend) : step;
}

// Phi(t) = x1 x1' + (rho − r_h) rho' = 0 at a local minimum of the distance to the rim; kNone: of
// the other kind, or apart by more than `far`
Search searchRim(const Peg& e, double r_h, double far, int slot, Place& at, Meridian& m) {
  for (int i = 0; i < kNewtonLimit; ++i) {
    meridian(e, at, m);
    const double out = m.rho - r_h;
    const double value = m.x1 * m.dx1 + out * m.drho;
    const double slope = m.dx1 * m.dx1 - m.x1 * m.u1 + m.drho * m.drho + out * m.ddrho;
    if (!(slope > 0.0)) return Search::kFailed;
    bool last = false;
    const double step = halley(value, slope, 1.5 * (m.drho * m.ddrho - m.dx1 * m.u1), last);
    if (!(std::abs(step) < 0.5)) return Search::kFailed;
    at = stepBack(at, step);
    if (last) {
      edgePoint(e, at, m);
      // 1/rho from its neighbour: one Newton step squares an error of the order of `step`
      const double rho2 = m.x2 * m.x2 + m.x3 * m.x3;
      m.inverse_rho += step * m.drho * m.inverse_rho * m.inverse_rho;
      m.inverse_rho *= 1.5 - 0.5 * rho2 * m.inverse_rho * m.inverse_rho;
      m.rho = rho2 * m.inverse_rho;
      m.drho = (m.x2 * m.dx2 + m.x3 * m.dx3) * m.inverse_rho;
      return admissible(m, slot) ? Search::kFound : Search::kNone;
    }
    const bool above = m.x1 > 0.0 && out < 0.0 && std::abs(step) < 0.1;
    if (above && m.x1 * m.x1 + out * out - value * step > far * far) return Search::kNone;
  }
  return Search::kFailed;
}

// a candidate without a warm start; `reach`: crossings higher over the plane may be left out
Search searchRimCold(const Peg& e, double r_h, double reach, int slot, Place& at, Meridian& m) {
  // where the edge, if it were upright, crosses the hole's cylinder
  const double side = slot == 0 ? 1.0 : -1.0;
  const double c =
      std::clamp((r_h * r_h - e.r * e.r - e.offset * e.offset) / (2 * e.r * e.offset), -1.0, 1.0);
  const double s = std::sqrt(1.0 - c * c);
  Place out{};
  if (!placeTowards(e.p2 * e.c2 + e.p3 * e.c3, e.q2 * e.c2 + e.q3 * e.c3, out)) {
    return Search::kNone;
  }
  const Place crossing{c * out.c + side * s * out.s, c * out.s - side * s * out.c, 0.0};

  // no contact where it crosses well above the plane; tilt moves the crossing by no more than the
  // shift: the projected ellipse is narrower than the circle by r (1 − cos tilt). The gap is the
  // height times the normal's slope, at least height / (1 + A/slope)
  const double slope = e.offset * s;
  const double shift = e.amplitude * e.sine;
  const double height = e.c1 + crossing.c * e.p1 + crossing.s * e.q1 - reach;
  if (shift < 0.3 * slope && height * slope > e.amplitude * (2 * shift + reach))
    return Search::kNone;

  at = placeOf(crossing.c, crossing.s);
  Search search = searchRim(e, r_h, 4 * reach, slot, at, m);
  if (search == Search::kFound || !(e.amplitude > 0.0)) return search;
  // second start: where the edge crosses the plane
  const double cp = std::clamp(e.c1 / e.amplitude, -1.0, 1.0), sp = side * std::sqrt(1 - cp * cp);
  at = placeOf(e.lc * cp - e.ls * sp, e.ls * cp + e.lc * sp);
  const Search second = searchRim(e, r_h, 4 * reach, slot, at, m);
  if (second != Search::kFailed) return second;
  if (search != Search::kFailed) return search;

  // last resort: the nearest point of the right kind among samples of the half circle
  double best = kInfinity;
  const double turn = -side * kPi / kScanPoints;
  Place sample = stepBack({e.lc, e.ls, 0.0}, 0.5 * turn), start{};
  for (int i = 0; i < kScanPoints; ++i) {
    meridian(e, sample, m);
    const double distance = m.x1 * m.x1 + square(m.rho - r_h);
    if (distance < best && admissible(m, slot)) {
      best = distance;
      start = sample;
    }
    sample = stepBack(sample, turn);
  }
  if (!(best < kInfinity)) return Search::kNone;
  at = placeOf(start.c, start.s);
  return searchRim(e, r_h, kInfinity, slot, at, m);
}

void edgeEdge(const Peg& e, double r_h, double reach, int slot, bool warm, ContactPoint& contact) {
  Place at{contact.cos_t, contact.sin_t, contact.t};
  contact.valid = false;
  // the edge stays inside the hole's cylinder, or outside it: no crossing, no contact
  if (e.offset + e.r <= r_h || e.offset >= e.r + r_h || e.offset < 1e-15) return;
  // nor where all of it is deeper than it reaches sideways into the block
  if (e.c1 + e.amplitude < -(e.offset + e.r - r_h)) return;

  Meridian m;
  Search search = warm ? searchRim(e, r_h, kInfinity, slot, at, m) : Search::kFailed;
  if (search != Search::kFound) search = searchRimCold(e, r_h, reach, slot, at, m);
  if (search != Search::kFound) return;
  const double norm = std::sqrt(m.dx1 * m.dx1 + m.drho * m.drho);
  if (!(norm > kParallel * e.r)) return;

  // up and towards the axis; in the peg's cone too, else side or face of the peg are nearer
  const double inverse = 1.0 / norm;
  const double up = std::abs(m.drho) * inverse, inward = std::abs(m.dx1) * inverse;
  const double e2 = m.x2 * m.inverse_rho, e3 = m.x3 * m.inverse_rho;
  const double n2 = -inward * e2, n3 = -inward * e3;
  if (up * e.a1 + n2 * e.a2 + n3 * e.a3 < 0.0 || up * m.u1 + n2 * m.u2 + n3 * m.u3 > 0.0) return;
  // deeper than the edge reaches sideways into the wall before it turns back: not at the rim
  const double out = m.rho - r_h, gap = up * m.x1 - inward * out;
  if (gap < 0.0 && m.ddrho < 0.0 && m.drho * m.drho < 2 * m.ddrho * (out + gap)) return;

  contact.valid = true;
  contact.feature = ContactFeature::kEdgeEdge;
  contact.t = at.t;
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.p = {m.x1, m.x2, m.x3};
  contact.dp = {m.dx1, m.dx2, m.dx3};
  contact.rim = {0.0, r_h * e2, r_h * e3};
  contact.tangent = {0.0, -r_h * e3, r_h * e2};
  contact.normal = {up, n2, n3};
  contact.cross_norm = (slot == 0 ? -r_h : r_h) * norm;
  contact.gap = gap;
  contact.curvature = 0.0;
}

// ---- the peg's edge against plane, floor and wall

void edgePlane(const Peg& e, const ContactShapes& shapes, double far, ContactPoint& contact) {
  contact.valid = false;
  const double lowest = e.c1 - e.amplitude;
  const bool floor = lowest <= far - shapes.hole_depth;
  if (!(lowest <= far)) return;
  Place at{e.lc, e.ls, 0.0};
  // parallel to the plane: the edge point farthest from the hole's axis stands for the face
  if (!(e.sine > kLevel)) {
    const bool directed =
        e.offset >= 1e-15 && placeTowards(e.p2 * e.c2 + e.p3 * e.c3, e.q2 * e.c2 + e.q3 * e.c3, at);
    if (!directed && !floor) return;
  }
  Meridian m;
  edgePoint(e, at, m);
  const double rho2 = m.x2 * m.x2 + m.x3 * m.x3, r_h = shapes.hole_radius;
  const bool outside = rho2 > r_h * r_h;
  if (!outside && !floor) return;
  double level = outside ? 0.0 : -shapes.hole_depth;
  if (outside && lowest < 0.0 && square(r_h - lowest) > rho2) {
    // deeper than it reaches sideways into the wall before it turns back: in the hole
    meridian(e, at, m);
    const double sideways = lowest + m.rho - r_h;
    if (m.ddrho < 0.0 && m.drho * m.drho < 2 * m.ddrho * sideways) {
      if (!floor) return;
      level = -shapes.hole_depth;
    }
  }
  contact.valid = true;
  contact.feature = ContactFeature::kEdgePlane;
  contact.t = std::atan2(at.s, at.c);
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.p = {m.x1, m.x2, m.x3};
  contact.dp = {m.dx1, m.dx2, m.dx3};
  contact.rim = {level, m.x2, m.x3};
  contact.tangent.setZero();
  contact.normal = Eigen::Vector3d::UnitX();
  contact.cross_norm = 0.0;
  contact.gap = lowest - level;
  contact.curvature = 0.0;
}

// Newton on (rho²/2)' = 0 to a local maximum of rho; kNone: smaller than `least`
Search searchWall(const Peg& e, double least, Place& at, Meridian& m) {
  for (int i = 0; i < kNewtonLimit; ++i) {
    edgePoint(e, at, m);
    // of (rho²/2)' and its derivative, with p' · (p − centre) = 0 and |p'| = |p − centre|: nothing
    // large cancels near the axis
    const double value = e.c2 * m.dx2 + e.c3 * m.dx3 - m.u1 * m.dx1;
    const double slope = m.u1 * m.u1 - m.dx1 * m.dx1 - (e.c2 * m.u2 + e.c3 * m.u3);
    if (!(slope < 0.0)) return Search::kFailed;
    bool last = false;
    const double half_bend = 2 * m.u1 * m.dx1 - 0.5 * (e.c2 * m.dx2 + e.c3 * m.dx3);
    const double step = halley(value, slope, half_bend, last);
    if (!(std::abs(step) < 0.7)) return Search::kFailed;
    const double rho2 = m.x2 * m.x2 + m.x3 * m.x3;
    // the largest rho² of the parabola here, and as much again for what that leaves out
    if (std::abs(step) < 0.2 && rho2 - 2 * value * step < square(std::max(least, 0.0))) {
      return Search::kNone;
    }
    at = stepBack(at, step);
    if (last) {
      edgePoint(e, at, m);
      m.ddrho = slope;
      return Search::kFound;
    }
  }
  return Search::kFailed;
}

void fillWall(const Place& at, const Meridian& m, double r_h, ContactPoint& contact) {
  const double e2 = m.x2 * m.inverse_rho, e3 = m.x3 * m.inverse_rho;
  contact.valid = true;
  contact.feature = ContactFeature::kEdgeWall;
  contact.t = at.t;
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.p = {m.x1, m.x2, m.x3};
  contact.dp = {m.dx1, m.dx2, m.dx3};
  contact.rim = {m.x1, r_h * e2, r_h * e3};
  contact.tangent.setZero();
  contact.normal = {0.0, -e2, -e3};
  contact.cross_norm = 0.0;
  contact.gap = r_h - m.rho;
  contact.curvature = m.inverse_rho;
}

// is a farthest place of the edge a contact with the wall: below the plane, and not so flat under
// it that the plane is nearer
bool acceptWall(const Peg& e, double r_h, double far, Meridian& m) {
  if (!(m.x1 <= kTouch * e.r)) return false;
  m.rho = std::sqrt(m.x2 * m.x2 + m.x3 * m.x3);
  m.inverse_rho = 1.0 / m.rho;
  const double depth = m.rho - r_h;
  if (!(-depth <= far)) return false;
  const double below = depth + m.x1;
  if (below <= 0.0 || depth <= 0.0) return true;
  // the edge comes back out of the wall at sqrt(2 depth/|rho''|) to both sides; how deep on one
  return square(below) * -m.ddrho * m.inverse_rho <= m.dx1 * m.dx1 * 2 * depth;
}

// of two slots of one kind: those admitted are empty now, the others hold their places; how many
int held(ContactSet& set, ContactSlotMask admitted, std::size_t first) {
  int places = 0;
  for (std::size_t i = first; i < first + 2; ++i) {
    if (admitted >> i & 1u) set.slots[i].valid = false;
    places += set.slots[i].valid ? 1 : 0;
  }
  return places;
}

bool sameAngle(const ContactPoint& a, const Place& b) {
  return std::abs(a.sin_t * b.c - a.cos_t * b.s) < kMerged && a.cos_t * b.c + a.sin_t * b.s > 0.0;
}

// farthest (wall) or nearest (side) places of an ellipse from a point, closed-form start: the
// circle of radius r tilted by its sine, its centre at (x0, y0) from the point along major and
// minor axis. `end`: of the major axis (farthest) or minor axis (nearest), ±1
bool ellipseStart(double r, double sine, double cosine, double x0, double y0, double end,
                  bool nearest, Place& at) {
  const double bend = r * sine * sine;
  double lead = end;
  for (int i = 0; i < 2; ++i) {
    const bool directed = nearest ? placeTowards(-x0, bend * lead - cosine * y0, at)
                                  : placeTowards(x0 + bend * lead, cosine * y0, at);
    if (!directed) return false;
    lead = nearest ? at.s : at.c;
  }
  return true;
}

void edgeWall(const Peg& e, double r_h, double far, ContactSlotMask admitted, ContactSet& set) {
  const ContactSlotMask warm = set.valid & admitted & kEdgeWallSlots;
  int found = held(set, admitted, 3);
  if (e.offset + e.r < r_h - far) return;
  const double bend = e.amplitude * e.sine;
  if (!(e.offset > kCoaxial * e.r) && !(bend > kCoaxial * e.r)) return;
  // one farthest place only, near the direction of the offset: skipped where it's flat under the
  // plane or above it
  const bool single = e.offset * e.a1 > bend;
  Place towards{};
  if (!warm && e.offset > 2 * bend) {
    if (e.offset + e.r * e.a1 - r_h > e.amplitude - e.c1) return;
    if (!placeTowards(e.p2 * e.c2 + e.p3 * e.c3, e.q2 * e.c2 + e.q3 * e.c3, towards)) return;
    const double height = e.c1 + towards.c * e.p1 + towards.s * e.q1;
    if (height * e.offset > 2 * e.amplitude * bend + kTouch * e.r * e.offset) return;
  }

  Meridian m;
  for (int slot = 3; slot < 5; ++slot) {
    if (!(warm >> slot & 1u)) continue;
    ContactPoint& contact = set.slots[static_cast<std::size_t>(slot)];
    Place at{contact.cos_t, contact.sin_t, contact.t};
    if (searchWall(e, r_h - far, at, m) != Search::kFound || !acceptWall(e, r_h, far, m)) continue;
    const ContactPoint& twin = set.slots[static_cast<std::size_t>(7 - slot)];
    if (twin.valid && sameAngle(twin, at)) continue;
    fillWall(at, m, r_h, contact);
    ++found;
  }
  if (found == 2 || (found == 1 && single)) return;

  // places anew, the farther one first, into the free slots
  const double low2 = (e.lc * e.p2 + e.ls * e.q2) / e.r, low3 = (e.lc * e.p3 + e.ls * e.q3) / e.r;
  const double major2 = (e.lc * e.q2 - e.ls * e.p2) / e.r;
  const double major3 = (e.lc * e.q3 - e.ls * e.p3) / e.r;
  // the minor axis's image has length cos(tilt): low2, low3 carry it
  const double x0 = major2 * e.c2 + major3 * e.c3, y0 = -(low2 * e.c2 + low3 * e.c3);
  const double first = x0 >= 0.0 ? 1.0 : -1.0;
  for (int k = 0; k < (single ? 1 : 2) && found < 2; ++k) {
    Place at{};
    if (!ellipseStart(e.r, e.sine, 1.0, x0, y0, k == 0 ? first : -first, false, at)) continue;
    // from the axes of the ellipse (major, −low) to t
    at = placeOf(-at.c * e.ls - at.s * e.lc, at.c * e.lc - at.s * e.ls);
    if (searchWall(e, r_h - far, at, m) != Search::kFound || !acceptWall(e, r_h, far, m)) continue;
    if ((set.slots[3].valid && sameAngle(set.slots[3], at)) ||
        (set.slots[4].valid && sameAngle(set.slots[4], at))) {
      continue;
    }
    const std::size_t slot = admitted >> 3 & 1u && !set.slots[3].valid ? 3 : 4;
    if (!(admitted >> slot & 1u) || set.slots[slot].valid) continue;
    fillWall(at, m, r_h, set.slots[slot]);
    ++found;
  }
}

// ---- the rim against the peg's side and bottom face

// a place of the rim in the peg's cylinder coordinates and their derivatives by s
struct RimPlace {
  double h2, h3;                   // H
  double s1, s2, s3;               // from the peg's axis to H, across the axis
  double height, dheight;          // w along the axis
  double value, slope, half_bend;  // of (sigma²/2)' and its derivatives
  double sigma2;                   // squared distance from the axis
};

// the hole's centre as the peg sees it
struct HoleOffset {
  double along;       // axis · bottom centre: minus its height over the peg's face
  double o1, o2, o3;  // its offset from the peg's axis, across the axis
};

HoleOffset holeOffset(const Peg& e) {
  const double along = e.a1 * e.c1 + e.a2 * e.c2 + e.a3 * e.c3;
  return {along, along * e.a1 - e.c1, along * e.a2 - e.c2, along * e.a3 - e.c3};
}

void rimPlace(const Peg& e, const HoleOffset& o, double r_h, const Place& at, RimPlace& m) {
  m.h2 = r_h * at.c;
  m.h3 = r_h * at.s;
  const double rise = e.a2 * m.h2 + e.a3 * m.h3;
  m.height = rise - o.along;
  m.dheight = e.a3 * m.h2 - e.a2 * m.h3;
  m.s1 = o.o1 - rise * e.a1;
  m.s2 = o.o2 + m.h2 - rise * e.a2;
  m.s3 = o.o3 + m.h3 - rise * e.a3;
  m.sigma2 = m.s1 * m.s1 + m.s2 * m.s2 + m.s3 * m.s3;
  const double turned = o.o3 * m.h2 - o.o2 * m.h3;
  m.value = turned - rise * m.dheight;
  m.half_bend = 2 * rise * m.dheight - 0.5 * turned;
  m.slope = rise * rise - m.dheight * m.dheight - (o.o2 * m.h2 + o.o3 * m.h3);
}

// Newton on (sigma²/2)' = 0 to a local minimum of the distance from the peg's axis; kNone: larger
// than `most`
Search searchSide(const Peg& e, const HoleOffset& o, double r_h, double most, Place& at,
                  RimPlace& m) {
  for (int i = 0; i < kNewtonLimit; ++i) {
    rimPlace(e, o, r_h, at, m);
    if (!(m.slope > 0.0)) return Search::kFailed;
    bool last = false;
    const double step = halley(m.value, m.slope, m.half_bend, last);
    if (!(std::abs(step) < 0.7)) return Search::kFailed;
    if (std::abs(step) < 0.2 && m.sigma2 - 2 * m.value * step > most * most) return Search::kNone;
    at = stepBack(at, step);
    if (last) {
      rimPlace(e, o, r_h, at, m);
      return Search::kFound;
    }
  }
  return Search::kFailed;
}

void fillRim(const Place& at, const RimPlace& m, double r_h, ContactFeature feature,
             const Eigen::Vector3d& normal, double gap, double curvature, ContactPoint& contact) {
  contact.valid = true;
  contact.feature = feature;
  contact.t = at.t;
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.rim = {0.0, m.h2, m.h3};
  contact.p = contact.rim + gap * normal;
  contact.dp.setZero();
  contact.tangent = {0.0, -r_h * at.s, r_h * at.c};
  contact.normal = normal;
  contact.cross_norm = 0.0;
  contact.gap = gap;
  contact.curvature = curvature;
}

// is a nearest place of the rim a contact with the side: over the bottom edge, and not so flat over
// it that the face is nearer
bool acceptSide(const Peg& e, const ContactShapes& shapes, double far, RimPlace& m, double& sigma,
                bool& top_reached) {
  if (!(m.height >= -kTouch * e.r)) return false;
  sigma = std::sqrt(m.sigma2);
  const double depth = e.r - sigma;
  if (!(-depth <= far) || !(sigma > kParallel * e.r)) return false;
  if (m.height > shapes.peg_length) {
    top_reached = true;
    return false;
  }
  const double below = depth - m.height;
  if (below <= 0.0 || depth <= 0.0) return true;
  return square(below) * m.slope <= m.dheight * m.dheight * 2 * depth * sigma;
}

void rimSide(const Peg& e, const ContactShapes& shapes, double far, ContactSlotMask admitted,
             ContactSet& set) {
  const ContactSlotMask warm = set.valid & admitted & kRimSideSlots;
  int found = held(set, admitted, 5);
  const double r_h = shapes.hole_radius;
  const HoleOffset o = holeOffset(e);
  const double highest = r_h * e.sine - o.along;  // of the rim over the face
  if (!(highest >= -kTouch * e.r)) return;
  const double offset = std::sqrt(o.o1 * o.o1 + o.o2 * o.o2 + o.o3 * o.o3);
  if (r_h * e.a1 - offset > e.r + far) return;
  const double bend = r_h * e.sine * e.sine;
  if (!(offset > kCoaxial * e.r) && !(bend > kCoaxial * e.r)) return;
  const bool single = offset * e.a1 > bend;
  if (!warm && offset > 2 * bend) {
    if (e.r - (r_h - offset) > highest && offset < r_h) return;
    // the nearest place is off the direction of the offset by the ellipse's bend
    Place towards{};
    const bool directed = placeTowards(-o.o2, -o.o3, towards);
    const double height = r_h * (e.a2 * towards.c + e.a3 * towards.s) - o.along;
    if (directed && height * offset < -4 * r_h * e.sine * bend - kTouch * e.r * offset) return;
  }

  RimPlace m;
  double sigma = 0.0;
  const auto fill = [&](const Place& at, ContactPoint& contact) {
    const double inverse = 1.0 / sigma;
    const Eigen::Vector3d normal(-m.s1 * inverse, -m.s2 * inverse, -m.s3 * inverse);
    fillRim(at, m, r_h, ContactFeature::kRimSide, normal, sigma - e.r, inverse, contact);
    ++found;
  };
  for (int slot = 5; slot < 7; ++slot) {
    if (!(warm >> slot & 1u)) continue;
    ContactPoint& contact = set.slots[static_cast<std::size_t>(slot)];
    Place at{contact.cos_t, contact.sin_t, contact.t};
    if (searchSide(e, o, r_h, e.r + far, at, m) != Search::kFound ||
        !acceptSide(e, shapes, far, m, sigma, set.top_reached)) {
      continue;
    }
    const ContactPoint& twin = set.slots[static_cast<std::size_t>(11 - slot)];
    if (twin.valid && sameAngle(twin, at)) continue;
    fill(at, contact);
  }
  if (found == 2 || (found == 1 && single)) return;

  // places anew, the nearer one first, into the free slots; the rim seen along the axis is an
  // ellipse, its minor axis along the lean
  const bool level = !(e.sine > kLevel);
  const double l2 = level ? 1.0 : e.a2 / e.sine, l3 = level ? 0.0 : e.a3 / e.sine;
  const double x0 = o.o3 * l2 - o.o2 * l3;
  const double y0 = (o.o2 * l2 + o.o3 * l3) * e.a1 - o.o1 * e.sine;
  const double first = y0 <= 0.0 ? 1.0 : -1.0;
  for (int k = 0; k < (single ? 1 : 2) && found < 2; ++k) {
    Place at{};
    if (!ellipseStart(r_h, e.sine, e.a1, x0, y0, k == 0 ? first : -first, true, at)) continue;
    // from the axes of the ellipse (across, lean) to s
    at = placeOf(at.s * l2 - at.c * l3, at.s * l3 + at.c * l2);
    if (searchSide(e, o, r_h, e.r + far, at, m) != Search::kFound ||
        !acceptSide(e, shapes, far, m, sigma, set.top_reached)) {
      continue;
    }
    if ((set.slots[5].valid && sameAngle(set.slots[5], at)) ||
        (set.slots[6].valid && sameAngle(set.slots[6], at))) {
      continue;
    }
    const std::size_t slot = admitted >> 5 & 1u && !set.slots[5].valid ? 5 : 6;
    if (!(admitted >> slot & 1u) || set.slots[slot].valid) continue;
    fill(at, set.slots[slot]);
  }
}

void rimFace(const Peg& e, const ContactShapes& shapes, double far, ContactPoint& contact) {
  contact.valid = false;
  const double r_h = shapes.hole_radius;
  const HoleOffset o = holeOffset(e);
  const double highest = r_h * e.sine - o.along;
  if (!(-highest <= far)) return;
  // parallel to the plane: the rim point nearest to the peg's axis stands for the face
  Place at{};
  const bool directed = e.sine > kLevel ? placeTowards(e.a2, e.a3, at)
                                        : e.offset >= 1e-15 && placeTowards(e.c2, e.c3, at);
  if (!directed) return;
  RimPlace m;
  rimPlace(e, o, r_h, at, m);
  if (!(m.sigma2 < e.r * e.r)) return;
  const double sigma = std::sqrt(m.sigma2);
  // farther over the face than it reaches in from the side before it turns back: at the side
  const double inside = e.r - sigma - m.height;
  if (inside < 0.0 && m.height > 0.0 && m.slope > 0.0 &&
      m.value * m.value < -2 * m.slope * inside * sigma) {
    return;
  }
  at.t = std::atan2(at.s, at.c);
  fillRim(at, m, r_h, ContactFeature::kRimFace, {e.a1, e.a2, e.a3}, -m.height, 0.0, contact);
}

// at a hand-over both neighbours may hold by rounding, at one place: the edge–edge candidate stays
void dropDoubles(double r, ContactSet& set, ContactSlotMask& valid) {
  for (std::size_t i = 0; i < 2; ++i) {
    if (!set.slots[i].valid) continue;
    for (std::size_t j = i == 0 ? 1 : 2; j < set.slots.size(); ++j) {
      if (!set.slots[j].valid) continue;
      const double distance2 = (set.slots[i].p - set.slots[j].p).squaredNorm();
      if (distance2 > square(kMerged * r)) continue;
      if (set.slots[i].normal.dot(set.slots[j].normal) < 1.0 - 1e-9) continue;
      set.slots[j].valid = false;
      valid &= ~(1u << j);
    }
  }
}

}  // namespace

const char* toString(ContactFeature feature) {
  switch (feature) {
    case ContactFeature::kEdgeEdge:
      return "edge_edge";
    case ContactFeature::kEdgePlane:
      return "edge_plane";
    case ContactFeature::kEdgeWall:
      return "edge_wall";
    case ContactFeature::kRimSide:
      return "rim_side";
    case ContactFeature::kRimFace:
      return "rim_face";
  }
  return "unknown";
}

EdgeHeight edgeHeight(const EdgeCircle& e) {
  return {e.center(0), e.radius * std::sqrt(square(e.axis0(0)) + square(e.axis1(0)))};
}

ContactSlotMask findContacts(const EdgeCircle& edge, const ContactShapes& shapes,
                             ContactSlotMask admitted, ContactSet& set) {
  set.top_reached = false;
  // all of the peg is above the plane: the height test needs neither root nor search
  const double above = edge.center(0) - shapes.reach;
  const double amplitude2 = square(edge.radius) * (square(edge.axis0(0)) + square(edge.axis1(0)));
  if (!(above <= 0.0 || above * above <= amplitude2)) {
    set.valid = 0;
    return 0;
  }

  const Peg e(edge);
  if (!e.finite()) {
    set.valid = 0;
    return 0;
  }
  const double far = 2 * shapes.reach;
  for (int slot = 0; slot < 2; ++slot) {
    ContactPoint& contact = set.slots[static_cast<std::size_t>(slot)];
    contact.valid = false;
    if (!(admitted >> slot & 1u)) continue;
    edgeEdge(e, shapes.hole_radius, shapes.reach, slot, set.valid >> slot & 1u, contact);
    if (!(contact.gap <= far)) contact.valid = false;
  }
  set.slots[2].valid = false;
  if (admitted & kEdgePlaneSlots) edgePlane(e, shapes, far, set.slots[2]);
  if (admitted & kEdgeWallSlots) edgeWall(e, shapes.hole_radius, far, admitted, set);
  if (admitted & kRimSideSlots) rimSide(e, shapes, far, admitted, set);
  set.slots[7].valid = false;
  if (admitted & kRimFaceSlots) rimFace(e, shapes, far, set.slots[7]);

  ContactSlotMask valid = 0;
  for (std::size_t i = 0; i < set.slots.size(); ++i) {
    if (admitted >> i & 1u && set.slots[i].valid) valid |= 1u << i;
  }
  if (valid & kEdgeEdgeSlots && valid & (valid - 1)) dropDoubles(e.r, set, valid);
  set.valid = valid;
  return valid;
}

double contactClearance(const EdgeCircle& edge, const ContactShapes& shapes) {
  const Peg e(edge);
  const double lowest = e.c1 - e.amplitude;
  if (lowest > 0.0) return lowest;
  if (!(e.a1 > 0.1)) return 0.0;
  // level slices of the peg from the bottom to the plane: ellipses no longer than r / cos(tilt)
  const double lift = -e.c1 / e.a1;
  const double at_plane = std::sqrt(square(e.c2 + lift * e.a2) + square(e.c3 + lift * e.a3));
  const double wall = (shapes.hole_radius - std::max(e.offset, at_plane)) * e.a1 - e.r;
  return std::max(0.0, std::min(wall, lowest + shapes.hole_depth));
}

ContactPoint findEdgeEdge(const EdgeCircle& e, double r_h, int slot, bool use_warm, double warm) {
  ContactPoint contact;
  contact.t = warm;
  contact.cos_t = std::cos(warm);
  contact.sin_t = std::sin(warm);
  edgeEdge(Peg(e), r_h, ContactShapes().reach, slot, use_warm, contact);
  return contact;
}

ContactPoint findEdgePlane(const EdgeCircle& e, double r_h) {
  ContactPoint contact;
  ContactShapes shapes;
  shapes.hole_radius = r_h;
  edgePlane(Peg(e), shapes, kInfinity, contact);
  return contact;
}

}  // namespace assembly_cell
