// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The peg's edge against the chamfer of the hole.
#include <algorithm>

#include "contact_search.h"

namespace assembly_cell {
namespace contact_search {
namespace {

// Height of a point over the cone, and its derivatives along the edge.
struct ConePlace {
  Meridian m;
  double gap;
};

Extremum conePlace(const Peg& e, const Rim& rim, const Place& at, ConePlace& place) {
  Meridian& m = place.m;
  edgePoint(e, at, m);
  m.rho = levelNorm(m.x);
  m.inverse_rho = m.rho > 0.0 ? 1.0 / m.rho : 0.0;
  // derivatives of rho²/2, without cancellation near the axis, see edgeWall()
  double first, second, third;
  if (e.leans()) {
    first = levelDot(m.x, m.dx);
    second = levelDot(m.dx, m.dx) - levelDot(m.x, m.u);
    third = -3.0 * levelDot(m.dx, m.u) - first;
  } else {
    const double along = levelDot(e.center, m.dx), u = m.u(0), dx = m.dx(0);
    first = along - u * dx;
    second = u * u - dx * dx - levelDot(e.center, m.u);
    third = 4.0 * u * dx - along;
  }
  m.drho = first * m.inverse_rho;
  m.ddrho = (second - m.drho * m.drho) * m.inverse_rho;
  const double dddrho = (third - 3.0 * m.drho * m.ddrho) * m.inverse_rho;
  const double s = rim.cone->sine, c = rim.cone->cosine;
  place.gap = s * m.x(0) + c * (rim.radius - m.rho);
  // derivatives of the gap, which is minimised
  return {s * m.dx(0) - c * m.drho, -s * m.u(0) - c * m.ddrho, 0.5 * (-s * m.dx(0) - c * dddrho),
          2 * place.gap};
}

// A minimum of the height is a contact: over the cone; of an overlap, only if neither plane nor
// wall has the smaller penetration all along it.
bool acceptCone(const Peg& e, const Rim& rim, double far, double bend, const ConePlace& place) {
  const Chamfer& cone = *rim.cone;
  const Meridian& m = place.m;
  if (!(place.gap <= far)) return false;
  const double foot = m.x(0) - place.gap * cone.sine;
  if (!(foot <= kTouch * e.r && foot >= -cone.height - kTouch * e.r)) return false;
  const double depth = -place.gap;
  if (depth <= 0.0) return true;
  // the edge leaves the cone at ±sqrt(2 depth/gap'')
  const double width2 = 2 * depth / bend;
  const Depth wall{m.rho - rim.radius + cone.width, m.drho, m.ddrho};
  return depth <= planeDepth(m).max(width2) && depth <= wall.max(width2);
}

}  // namespace

void edgeCone(const Peg& e, const Rim& rim, double far, std::size_t first_slot,
              ContactSlotMask admitted, ContactSet& set) {
  SlotPair pair(set, admitted, first_slot);
  const double s = rim.cone->sine, c = rim.cone->cosine;
  const double lean = e.leans() ? levelNorm(e.lean) : 0.0;
  const double lowest = e.center(0) - e.amplitude;
  // lower bound of the gap
  const double minimum = s * lowest + c * (rim.radius - e.offset - e.r - lean * e.amplitude);
  if (minimum > far) return;
  if (e.center(0) + e.amplitude + s * std::max(0.0, -minimum) < -rim.cone->height - kTouch * e.r) {
    return;
  }
  // the gap is a constant, a first harmonic with its minimum towards `steep`, and a second one
  const Vec3 low = (e.lc * e.p + e.ls * e.q) / e.r, major = (e.lc * e.q - e.ls * e.p) / e.r;
  const double along_low = s * e.amplitude + c * levelDot(low, e.center);
  const double along_major = c * levelDot(major, e.center);
  const double first = std::hypot(along_low, along_major);
  const double second =
      0.25 * c * (square(e.offset) + square(e.amplitude)) / e.r + c * lean * e.amplitude;
  if (!(first > kCoaxial * e.r) && !(second > kCoaxial * e.r)) return;
  const bool single = first > kOneMinimum * second;

  ConePlace place;
  Extremum extremum{};
  const auto evaluate = [&](const Place& at) { return conePlace(e, rim, at, place); };
  const auto find = [&](Place& at) {
    return searchExtremum(evaluate, 1.0, 2 * far, at, extremum) == Search::kFound &&
           acceptCone(e, rim, far, extremum.slope, place);
  };
  const auto start = [&](bool lower, Place& at) {
    if (single) {
      Place seen{};
      if (!placeTowards(along_low, along_major, seen)) return false;
      // from the axes of the ellipse (low, major) to t
      at = placeOf(seen.c * e.lc - seen.s * e.ls, seen.c * e.ls + seen.s * e.lc);
      return true;
    }
    const LowestPlaces lowest_places({e.lc, e.ls, 0.0}, [&](const Place& sample) {
      conePlace(e, rim, sample, place);
      return place.gap;
    });
    return lowest_places.start(lower, at);
  };
  fillPair(pair, single, find, start, [&](const Place& at, ContactPoint& contact) {
    const Meridian& m = place.m;
    const double e2 = m.x(1) * m.inverse_rho, e3 = m.x(2) * m.inverse_rho;
    setEdge(ContactFeature::kEdgeCone, at, m, contact);
    contact.gap = place.gap;
    contact.normal = {s, -c * e2, -c * e3};
    contact.tangent = {0.0, e3, -e2};
    contact.curvature = c * m.inverse_rho;
    contact.rim = combined(1.0, m.x, -place.gap, contact.normal);
    if (e.leans()) leanWall(e, c * levelDot(e.lean, m.x) * m.inverse_rho, contact);
  });
}

}  // namespace contact_search
}  // namespace assembly_cell
