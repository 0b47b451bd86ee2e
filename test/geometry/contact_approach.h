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
