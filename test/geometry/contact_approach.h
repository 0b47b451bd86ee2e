// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "contact_reference.h"

namespace assembly_cell {

struct Smallest {
  double gap = 1.0;
  int slot = -1;
};
inline Smallest smallest(const ContactSet& set) {
  Smallest best;
  for (int i = 0; i < kContactSlots; ++i) {
    const double gap = set.slots[static_cast<std::size_t>(i)].gap;
    if (set.valid >> i & 1u && gap < best.gap) best = {gap, i};
  }
  return best;
}
inline Smallest smallest(const EdgeCircle& e, const ContactShapes& shapes,
                         ContactSlotMask admitted = kAllContactSlots) {
  ContactSet set;
  findContacts(e, shapes, admitted, set);
  return smallest(set);
}

inline double overlap(const EdgeCircle& e, const ContactShapes& shapes) {
  return static_cast<double>(BodiesReference(e, shapes).overlap());
}

// A straight way through x1, x2, x3 and the tilt's two components that ends where the bodies touch.
struct Approach {
  ContactShapes shapes;
  std::array<double, 5> from, way;
  double spin, touch, radius = 0.025;

  EdgeCircle at(double q) const {
    std::array<double, 5> x;
    for (std::size_t i = 0; i < 5; ++i) x[i] = from[i] + q * way[i];
    return edgeAt({x[0], x[1], x[2]}, std::hypot(x[3], x[4]), std::atan2(x[4], x[3]), spin, radius);
  }

  // false where the way doesn't go from apart to overlapping, or not smoothly
  bool findTouch() {
    if (overlap(at(0), shapes) >= 0.0) return false;
    double high = 0.25, at_high = overlap(at(high), shapes);
    while (high < 15 && at_high <= 0.0) at_high = overlap(at(high += 0.25), shapes);
    if (at_high <= 0.0) return false;
    // regula falsi; an end that stays twice weighs half (Illinois)
    double low = high - 0.25, at_low = overlap(at(low), shapes), value = at_high;
    touch = high;
    for (int i = 0, side = 0; i < 80 && std::abs(value) > 1e-18; ++i) {
      touch = low + (high - low) * at_low / (at_low - at_high);
      value = overlap(at(touch), shapes);
      if (value > 0.0) {
        high = touch, at_high = value;
        if (side == 1) at_low *= 0.5;
        side = 1;
      } else {
        low = touch, at_low = value;
        if (side == -1) at_high *= 0.5;
        side = -1;
      }
    }
    return std::abs(value) <= 1e-16;
  }
};

// The function of the parameter t, in extended precision, whose minimum is the gap of a slot.
inline Real gapFunction(const BodiesReference& b, int slot, Real t) {
  const bool low = slot == 8 || slot == 9 || slot == 16 || slot == 17;
  const bool low_rim = b.chamfer > 0 && (slot == 5 || slot == 6 || slot == 25 || slot == 26);
  const Vec3L p = kShoulderSlots >> slot & 1u ? b.upperEdge(t) : b.edge(t);
  const Vec3L rim = low_rim ? b.rim(t) : b.mouth(t);
  switch (featureOfSlot(slot)) {
    case ContactFeature::kEdgeEdge:
      return low ? std::hypot(p(0) + b.chamfer, b.rho(p) - b.r_h)
                 : std::hypot(p(0), b.rho(p) - b.r_mouth);
    case ContactFeature::kEdgePlane:
      return p(0);
    case ContactFeature::kEdgeWall:
      return b.r_h - b.rho(p);
    case ContactFeature::kEdgeCone:
      return b.coneHeight(p);
    case ContactFeature::kRimSide:
      return b.axisDistance(rim) - b.r_side;
    case ContactFeature::kRimCone:
      return b.pegConeHeight(rim);
    case ContactFeature::kRimFace:
      break;
  }
  return -b.height(rim);
}

// Points, gaps and frames of all valid slots near the touch of an approach, apart and penetrating,
// against the minimum found by halving intervals of the slope. met: counts by slot.
inline void expectMinima(const Approach& a, std::array<int, kContactSlots>& met) {
  const double speed =
      std::hypot(a.way[0], a.way[1], a.way[2]) + 0.02 * std::hypot(a.way[3], a.way[4]);
  for (const double depth : {-1e-5, -1e-7, 1e-8, 1e-6}) {
    const EdgeCircle e = a.at(a.touch + depth / speed);
    const BodiesReference b(e, a.shapes);
    ContactSet set;
    findContacts(e, a.shapes, kAllContactSlots, set);
    for (int slot = 0; slot < kContactSlots; ++slot) {
      const ContactPoint& c = set.slots[static_cast<std::size_t>(slot)];
      if (!(set.valid >> slot & 1u)) continue;
      const std::string where =
          std::to_string(slot) + " " + toString(c.feature) + " gap " + std::to_string(c.gap);
      ASSERT_TRUE(possibleSlots(a.shapes) >> slot & 1u) << where;
      ASSERT_EQ(c.feature, featureOfSlot(slot));
      const bool rim = (kRimSideSlots | kRimFaceSlots | kRimConeSlots) >> slot & 1u;
      // zero distances have no smooth minimum: takes the square
      const bool squared = c.feature == ContactFeature::kEdgeEdge;
      const auto f = [&](Real t) {
        const Real value = gapFunction(b, slot, t);
        return squared ? value * value : value;
      };
      const Minimum minimum = minimumNear(c.t, f);
      ASSERT_TRUE(minimum.found) << where;
      const Real t = minimum.t, bend = minimum.bend;
      const bool low_rim = b.chamfer > 0 && (slot == 5 || slot == 6 || slot == 25 || slot == 26);
      const Vec3L on_circle = rim                           ? (low_rim ? b.rim(t) : b.mouth(t))
                              : kShoulderSlots >> slot & 1u ? b.upperEdge(t)
                                                            : b.edge(t);
      // rounding of the reference's slope (1e-21 m over the step) over its bend, times the radius;
      // squares are rounded at the gap's square
      EXPECT_LT((on_circle - (rim ? c.rim : c.p).cast<Real>()).norm(), 1e-12L + 1e-16L / bend)
          << where;
      const Real gap = gapFunction(b, slot, t);
      EXPECT_NEAR(static_cast<double>(squared ? std::abs(c.gap) - gap : c.gap - gap), 0.0, 1e-15)
          << where;
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-14);
      EXPECT_LT((c.gap * c.normal - (c.p - c.rim)).norm(), 1e-14) << where;
      EXPECT_LT(std::abs(c.normal.dot(rim ? c.tangent : c.dp)), 1e-14 + kRadius * 1e-10) << where;
      ++met[static_cast<std::size_t>(slot)];
    }
  }
}

using HandOvers = std::map<std::pair<ContactFeature, ContactFeature>, int>;

// Along a way of the peg, at(q) with q from 0 to 1, that stays near a contact: the smallest gap has
// no step, and where one feature follows another at one place neither has the normal. Counts these.
template <typename At>
void followHandOver(const At& at, const ContactShapes& shapes, double penetration,
                    const std::string& what, HandOvers& changes) {
  ContactSet set;
  Smallest last;
  constexpr int steps = 400;
  for (int k = 0; k <= steps; ++k) {
    const double q = static_cast<double>(k) / steps;
    findContacts(at(q), shapes, kAllContactSlots, set);
    const Smallest now = smallest(set);
    if (now.gap < -2 * penetration) break;
    const Smallest before_it = std::exchange(last, now);
    if (k == 0 || now.slot < 0 || before_it.slot < 0 || now.slot == before_it.slot) continue;
    double low = q - 1.0 / steps, high = q;
    for (int n = 0; n < 60; ++n) {
      const double middle = 0.5 * (low + high);
      (smallest(at(middle), shapes).slot == before_it.slot ? low : high) = middle;
    }
    ContactSet before, after;
    findContacts(at(low), shapes, kAllContactSlots, before);
    findContacts(at(high), shapes, kAllContactSlots, after);
    const Smallest b = smallest(before), f = smallest(after);
    if (b.slot < 0 || f.slot < 0) {
      // one that is apart may be left out for a while
      EXPECT_GT(std::min(before_it.gap, now.gap), 0.0) << what << " " << q;
      continue;
    }
    const ContactPoint& cb = before.slots[static_cast<std::size_t>(b.slot)];
    const ContactPoint& cf = after.slots[static_cast<std::size_t>(f.slot)];
    const bool same = (cb.p - cf.p).norm() < 1e-7;
    // an overlapping corner changes its nearest way out where two of them are alike, to second
    // order of the edge's curve: within half of its depth
    const double depth = std::max({0.0, -b.gap, -f.gap});
    EXPECT_NEAR(b.gap, f.gap, 1e-13 + (same ? 1e-4 * penetration : 0.5 * depth))
        << what << " " << q << " slots " << b.slot << " to " << f.slot;
    if (!same) continue;
    EXPECT_LT((cb.normal - cf.normal).norm(), 1e-5)
        << what << " " << toString(cb.feature) << " to " << toString(cf.feature);
    ++changes[{cb.feature, cf.feature}];
  }
}

}  // namespace assembly_cell
