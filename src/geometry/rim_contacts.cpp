// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The rim against the peg's side and bottom face.
#include "contact_search.h"

namespace assembly_cell {
namespace contact_search {
namespace {

// a place of the rim in the peg's cylinder coordinates and their derivatives by s
struct RimPlace {
  Vec3 H;                  // of the rim
  Vec3 across;             // from the peg's axis to H, across the axis
  double height, dheight;  // w along the axis
  Extremum extremum;       // of sigma²/2
};

// the hole's centre as the peg sees it
struct HoleOffset {
  double along;  // axis · bottom centre: minus its height over the peg's face
  Vec3 o;        // its offset from the peg's axis, across the axis

  explicit HoleOffset(const Peg& e) : along(e.axis.dot(e.center)), o(along * e.axis - e.center) {}
};

void rimPlace(const Peg& e, const HoleOffset& hole, double r_h, const Place& at, RimPlace& m) {
  m.H = {0.0, r_h * at.c, r_h * at.s};
  const Vec3 &a = e.axis, &o = hole.o;
  const double rise = levelDot(a, m.H);
  m.height = rise - hole.along;
  m.dheight = a(2) * m.H(1) - a(1) * m.H(2);
  m.across = {o(0) - rise * a(0), o(1) + m.H(1) - rise * a(1), o(2) + m.H(2) - rise * a(2)};
  const double turned = o(2) * m.H(1) - o(1) * m.H(2);
  m.extremum = {turned - rise * m.dheight, rise * rise - m.dheight * m.dheight - levelDot(o, m.H),
                2 * rise * m.dheight - 0.5 * turned, squaredNorm(m.across)};
}

void setRim(ContactFeature feature, const Place& at, const RimPlace& m, const Vec3& normal,
            double gap, ContactPoint& contact) {
  contact.valid = true;
  contact.feature = feature;
  contact.t = at.t;
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.p = combined(1.0, m.H, gap, normal);
  contact.dp.setZero();
  contact.rim = Vec3(m.H);
  contact.tangent = {0.0, -m.H(2), m.H(1)};
  contact.normal = Vec3(normal);
  contact.cross_norm = contact.curvature = 0.0;
  contact.gap = gap;
}

// is a nearest place of the rim a contact with the side: over the bottom edge, and not so flat over
// it that the face is nearer
bool acceptSide(const Peg& e, double peg_length, double far, const RimPlace& m, bool& top_reached) {
  if (!(m.height >= -kTouch * e.r)) return false;
  const double sigma = std::sqrt(m.extremum.distance2), depth = e.r - sigma;
  if (!(-depth <= far) || !(sigma > kParallel * e.r)) return false;
  if (m.height > peg_length) {
    top_reached = true;
    return false;
  }
  const double below = depth - m.height;
  if (below <= 0.0 || depth <= 0.0) return true;
  return square(below) * m.extremum.slope <= m.dheight * m.dheight * 2 * depth * sigma;
}

}  // namespace

void rimSide(const Peg& e, const Rim& rim, double peg_length, double far, ContactSlotMask admitted,
             ContactSet& set) {
  const std::size_t first = rim.cone && !rim.lower ? 12 : 5;
  const double r_h = rim.radius;
  SlotPair pair(set, admitted, 3u << first, first);
  const HoleOffset hole(e);
  const Vec3& o = hole.o;
  const double highest = r_h * e.sine - hole.along;  // of the rim over the face
  if (!(highest >= -kTouch * e.r)) return;
  const double offset = o.norm();
  if (r_h * e.axis(0) - offset > e.r + far) return;
  const double bend = r_h * e.sine * e.sine;
  if (!(offset > kCoaxial * e.r) && !(bend > kCoaxial * e.r)) return;
  const bool single = offset * e.axis(0) > bend;
  if (!pair.warm && offset > 2 * bend) {
    if (e.r - (r_h - offset) > highest && offset < r_h) return;
    // the nearest place is off the direction of the offset by the ellipse's bend
    Place towards{};
    const bool directed = placeTowards(-o(1), -o(2), towards);
    const double height = r_h * (e.axis(1) * towards.c + e.axis(2) * towards.s) - hole.along;
    if (directed && height * offset < -4 * r_h * e.sine * bend - kTouch * e.r * offset) return;
  }

  RimPlace m;
  Extremum extremum{};
  const auto evaluate = [&](const Place& at) {
    rimPlace(e, hole, r_h, at, m);
    return m.extremum;
  };
  const auto find = [&](Place& at) {
    return searchExtremum(evaluate, 1.0, square(e.r + far), at, extremum) == Search::kFound &&
           acceptSide(e, peg_length, far, m, set.top_reached);
  };
  const auto start = [&](bool nearer, Place& at) {
    // the rim seen along the axis, the minor axis along the lean
    const double l2 = e.tilted() ? e.axis(1) / e.sine : 1.0;
    const double l3 = e.tilted() ? e.axis(2) / e.sine : 0.0;
    const Ellipse seen{r_h, e.sine, e.axis(0), o(2) * l2 - o(1) * l3,
                       (o(1) * l2 + o(2) * l3) * e.axis(0) - o(0) * e.sine};
    if (!seen.start((seen.y <= 0.0) == nearer ? 1.0 : -1.0, true, at)) return false;
    // from the axes of the ellipse (across, lean) to s
    at = placeOf(at.s * l2 - at.c * l3, at.s * l3 + at.c * l2);
    return true;
  };
  fillPair(pair, single, find, start, [&](const Place& at, ContactPoint& contact) {
    const double sigma = std::sqrt(m.extremum.distance2), inverse = 1.0 / sigma;
    const Vec3& s = m.across;
    setRim(ContactFeature::kRimSide, at, m, {-s(0) * inverse, -s(1) * inverse, -s(2) * inverse},
           sigma - e.r, contact);
    contact.curvature = inverse;
  });
}

void rimFace(const Peg& e, double r_h, double far, ContactPoint& contact) {
  contact.valid = false;
  const HoleOffset hole(e);
  const double highest = r_h * e.sine - hole.along;
  if (!(-highest <= far)) return;
  // parallel to the plane: the rim point nearest to the peg's axis stands for the face
  Place at{};
  const Vec3& towards = e.tilted() ? e.axis : e.center;
  if (!e.tilted() && e.offset < kNoOffset) return;
  if (!placeTowards(towards(1), towards(2), at)) return;
  RimPlace m;
  rimPlace(e, hole, r_h, at, m);
  if (!(m.extremum.distance2 < e.r * e.r)) return;
  const double sigma = std::sqrt(m.extremum.distance2);
  // farther over the face than it reaches in from the side before it turns back: at the side
  const double inside = e.r - sigma - m.height;
  if (inside < 0.0 && m.height > 0.0 && m.extremum.slope > 0.0 &&
      m.extremum.value * m.extremum.value < -2 * m.extremum.slope * inside * sigma) {
    return;
  }
  at.t = std::atan2(at.s, at.c);
  setRim(ContactFeature::kRimFace, at, m, e.axis, -m.height, contact);
}

}  // namespace contact_search
}  // namespace assembly_cell
