// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cmath>

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

}  // namespace assembly_cell
