// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The rim against the peg's side, bottom face and chamfer.
#include <algorithm>
#include <array>

#include "contact_search.h"

namespace assembly_cell {
namespace contact_search {
namespace {

// Point of the rim in cylinder coordinates of the peg, and their derivatives by s.
struct RimPlace {
  Vec3 H;                  // point of the rim
  Vec3 across;             // from the peg's axis to H, normal to the axis
  double height, dheight;  // w along the axis
  Extremum extremum;       // of sigma²/2, sigma = |across|
};

// The hole's centre relative to the peg.
struct HoleOffset {
  double along;  // axis · bottom centre: minus the height of the hole's centre over the peg's face
  Vec3 o;        // its offset from the peg's axis, normal to the axis

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

// Point of the rim over the cone of the peg's chamfer (e: any of its circles), and the derivatives
// of its axis distance by s.
struct OverCone {
  double sigma, dsigma, ddsigma;
  double gap;
  Extremum extremum;  // derivatives of the gap, which is minimised

  OverCone(const Peg& e, const HoleOffset& hole, const RimPlace& m) {
    sigma = std::sqrt(m.extremum.distance2);
    const double inverse = sigma > 0.0 ? 1.0 / sigma : 0.0;
    dsigma = m.extremum.value * inverse;
    ddsigma = (m.extremum.slope - dsigma * dsigma) * inverse;
    const double dddsigma = (2 * m.extremum.half_bend - 3 * dsigma * ddsigma) * inverse;
    const double s = e.cone->sine, c = e.cone->cosine, rise = m.height + hole.along;
    gap = c * (sigma - e.r) - s * m.height;
    extremum = {c * dsigma - s * m.dheight, c * ddsigma + s * rise,
                0.5 * (c * dddsigma + s * m.dheight), 2 * gap};
  }
  // depth of the rim in the chamfer
  Depth depth() const { return {-gap, -extremum.value, -extremum.slope}; }
};

// A minimum of sigma is a contact with the side: above the edge where that begins, and the
// penetration of face or chamfer is not smaller.
bool acceptSide(const Peg& e, const HoleOffset& hole, double far, const RimPlace& m,
                bool& top_reached) {
  if (!(m.height >= -kTouch * e.r)) return false;
  const double sigma = std::sqrt(m.extremum.distance2), depth = e.r - sigma;
  if (!(-depth <= far) || !(sigma > kParallel * e.r)) return false;
  if (m.height > e.length) {
    top_reached = true;
    return false;
  }
  const double below = depth - m.height;
  if (depth <= 0.0) return true;
  // the rim leaves the side at ±sqrt(2 depth/sigma'')
  if (e.cone) {
    return depth <= OverCone(e, hole, m).depth().max(2 * depth * sigma / m.extremum.slope);
  }
  if (below <= 0.0) return true;
  return square(below) * m.extremum.slope <= m.dheight * m.dheight * 2 * depth * sigma;
}

// A minimum of the gap over the peg's chamfer is a contact: over the cone; of an overlap, only if
// neither face nor side has the smaller penetration all along it.
bool acceptCone(const Peg& e, const HoleOffset& hole, double far, const RimPlace& m,
                const OverCone& over) {
  const Chamfer& cone = *e.cone;
  if (!(over.gap <= far) || !(over.sigma > kParallel * e.r)) return false;
  const double foot = m.height + over.gap * cone.sine;
  if (!(foot >= -kTouch * e.r && foot <= cone.height + kTouch * e.r)) return false;
  const double depth = -over.gap;
  if (depth <= 0.0) return true;
  const double width2 = 2 * depth / over.extremum.slope;
  const Depth face{m.height, m.dheight, -(m.height + hole.along)};
  const Depth side{e.r + cone.width - over.sigma, -over.dsigma, -over.ddsigma};
  return depth <= face.max(width2) && depth <= side.max(width2);
}

}  // namespace

void rimSide(const Peg& e, const Rim& rim, double far, std::size_t first, ContactSlotMask admitted,
             ContactSet& set) {
  const double r_h = rim.radius;
  SlotPair pair(set, admitted, first);
  const HoleOffset hole(e);
  const Vec3& o = hole.o;
  const double highest = r_h * e.sine - hole.along;  // height of the rim over the face
  if (!(highest >= -kTouch * e.r)) return;
  const double offset = o.norm();
  if (r_h * e.axis(0) - offset > e.r + far) return;
  const double bend = r_h * e.sine * e.sine;
  if (!(offset > kCoaxial * e.r) && !(bend > kCoaxial * e.r)) return;
  const bool single = offset * e.axis(0) > bend;
  if (!pair.warm && offset > 2 * bend) {
    if (!e.cone && e.r - (r_h - offset) > highest && offset < r_h) return;
    // the minimum is off the direction of the offset by the curvature of the ellipse
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
           acceptSide(e, hole, far, m, set.top_reached);
  };
  const auto start = [&](bool nearer, Place& at) {
    // projection of the rim along the axis, the minor axis in the direction of tilt
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

void rimCone(const Peg& e, double r_h, double far, std::size_t first_slot, ContactSlotMask admitted,
             ContactSet& set) {
  SlotPair pair(set, admitted, first_slot);
  const double s = e.cone->sine, c = e.cone->cosine;
  const HoleOffset hole(e);
  const Vec3& o = hole.o;
  const double offset = o.norm(), swing = r_h * e.sine;
  const double highest = swing - hole.along, lowest = -swing - hole.along;  // heights over the face
  // lower bound of the gap
  const double minimum = c * (r_h * e.axis(0) - offset - e.r) - s * highest;
  if (minimum > far || !(highest + s * far >= -kTouch * e.r)) return;
  if (lowest + s * std::min(0.0, minimum) > e.cone->height + kTouch * e.r) return;
  // the gap is a constant plus a first and a second harmonic
  const double along_2 = s * r_h * e.axis(1) - c * o(1);
  const double along_3 = s * r_h * e.axis(2) - c * o(2);
  const double first = std::hypot(along_2, along_3);
  const double second = 0.25 * c * (square(offset) + square(swing)) / r_h;
  if (!(first > kCoaxial * e.r) && !(second > kCoaxial * e.r)) return;
  const bool single = first > kOneMinimum * second;

  RimPlace m;
  Extremum extremum{};
  double gap = 0.0;
  const auto evaluate = [&](const Place& at) {
    rimPlace(e, hole, r_h, at, m);
    const OverCone over(e, hole, m);
    gap = over.gap;
    return over.extremum;
  };
  const auto find = [&](Place& at) {
    return searchExtremum(evaluate, 1.0, 2 * far, at, extremum) == Search::kFound &&
           acceptCone(e, hole, far, m, OverCone(e, hole, m));
  };
  const auto start = [&](bool lower, Place& at) {
    if (single) {
      if (!placeTowards(along_2, along_3, at)) return false;
      at = placeOf(at.c, at.s);
      return true;
    }
    const LowestPlaces places({1.0, 0.0, 0.0}, [&](const Place& sample) {
      evaluate(sample);
      return gap;
    });
    return places.start(lower, at);
  };
  fillPair(pair, single, find, start, [&](const Place& at, ContactPoint& contact) {
    const double inverse = 1.0 / std::sqrt(m.extremum.distance2);
    setRim(ContactFeature::kRimCone, at, m, combined(-c * inverse, m.across, s, e.axis), gap,
           contact);
    contact.curvature = c * inverse;
  });
}

void rimFace(const Peg& e, double r_h, double far, ContactPoint& contact) {
  contact.valid = false;
  const HoleOffset hole(e);
  const double highest = r_h * e.sine - hole.along;
  if (!(-highest <= far)) return;
  // parallel to the plane: the rim point nearest to the peg's axis represents the face
  Place at{};
  const Vec3& towards = e.tilted() ? e.axis : e.center;
  if (!e.tilted() && e.offset < kNoOffset) return;
  if (!placeTowards(towards(1), towards(2), at)) return;
  RimPlace m;
  rimPlace(e, hole, r_h, at, m);
  if (!(m.extremum.distance2 < e.r * e.r)) return;
  const double sigma = std::sqrt(m.extremum.distance2);
  // higher over the face than the maximum overlap with side or chamfer: a contact of those
  if (e.cone && m.height > 0.0 && OverCone(e, hole, m).depth().turnsAbove(m.height)) return;
  const double inside = e.r - sigma - m.height;
  if (!e.cone && inside < 0.0 && m.height > 0.0 && m.extremum.slope > 0.0 &&
      m.extremum.value * m.extremum.value < -2 * m.extremum.slope * inside * sigma) {
    return;
  }
  at.t = std::atan2(at.s, at.c);
  setRim(ContactFeature::kRimFace, at, m, e.axis, -m.height, contact);
}

}  // namespace contact_search
}  // namespace assembly_cell
