// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// All five features against dense minimisation, their hand-overs, and the degenerate cases:
// parallel, coaxial, in a line. Thesis axes.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "contact_approach.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

class ContactFeatures : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }

  // inside: a centred upright peg in the hole, moved and tilted; else beside the hole, lowered
  Approach approach(bool inside) {
    for (;;) {
      Approach a;
      const double clearance = std::pow(10, uniform(-6, -2.7));
      a.shapes = shapesOf(clearance);
      a.spin = uniform(-4, 4);
      if (inside) {
        a.from = {-uniform(5e-4, 0.014), 0, 0, 0, 0};
        a.way = {0, clearance * uniform(-1, 1), clearance * uniform(-1, 1),
                 50 * clearance * uniform(-1, 1), 50 * clearance * uniform(-1, 1)};
        if (uniform(0, 1) < 0.2) a.way[1] = a.way[2] = 0.0;
        if (uniform(0, 1) < 0.2) a.way[3] = a.way[4] = 0.0;
      } else {
        const double where = uniform(-kPi, kPi), offset = uniform(0, 0.01);
        const double lean = where + kPi + uniform(-0.6, 0.6), tilt = uniform(0.001, 0.3);
        a.from = {0.03 * tilt + 0.003, offset * std::cos(where), offset * std::sin(where),
                  tilt * std::cos(lean), tilt * std::sin(lean)};
        a.way = {-0.003, 1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1), 1e-2 * uniform(-1, 1),
                 1e-2 * uniform(-1, 1)};
      }
      if (a.findTouch()) return a;
    }
  }

 private:
  std::mt19937_64 engine_{7};
};

// Where the bodies first touch by dense minimisation, the smallest gap is zero; before, none is
// negative. Each feature is met.
TEST_F(ContactFeatures, FirstTouchIsFound) {
  std::array<int, 5> met{};
  for (int i = 0; i < 120; ++i) {
    const Approach a = approach(i % 2 == 0);
    const Smallest touch = smallest(a.at(a.touch), a.shapes);
    ASSERT_GE(touch.slot, 0) << i;
    // the search finds 5e-17 m: lengths below 0.03 m, rounded
    EXPECT_NEAR(touch.gap, 0.0, 1e-15) << i << " slot " << touch.slot;
    ++met[static_cast<std::size_t>(featureOfSlot(touch.slot))];
    for (int k = 1; k < 20; ++k) {
      EXPECT_GE(smallest(a.at(a.touch * (1 - std::pow(0.6, k))), a.shapes).gap, -1e-15) << i;
    }
  }
  EXPECT_GT(met[0], 10);
  EXPECT_GT(met[1], 1);
  EXPECT_GT(met[2], 10);
  EXPECT_GT(met[3], 10);
}

// Points, gaps and frames near touch, see expectMinima().
TEST_F(ContactFeatures, PointsAndGapsAreTheMinima) {
  std::array<int, kContactSlots> met{};
  for (int i = 0; i < 120; ++i) expectMinima(approach(i % 2 == 0), met);
  EXPECT_GT(met[2], 3);
  for (const std::size_t slot : {0, 3, 5}) EXPECT_GT(met[slot] + met[slot + 1], 30) << slot;
}

// From any touch in the hole the peg is drawn out: features hand over at the rim. The smallest gap
// has the sign of the overlap all the way and no step, and where one feature follows another at the
// same place, neither gap nor normal jumps.
TEST_F(ContactFeatures, DrawnOutOfTheHoleFeaturesHandOver) {
  int changes = 0;
  for (int i = 0; i < 60; ++i) {
    Approach a = approach(true);
    const double penetration =
        std::array<double, 3>{1e-9, 1e-7, 2e-6}[static_cast<std::size_t>(i % 3)];
    const EdgeCircle start = a.at(a.touch);
    // sideways into the contact it found
    ContactSet set;
    findContacts(start, a.shapes, kAllContactSlots, set);
    const Vector3d into =
        -penetration * set.slots[static_cast<std::size_t>(smallest(set).slot)].normal;
    const double height = -start.center(0) + 2e-4;
    const auto at = [&](double q) {
      EdgeCircle e = start;
      e.center += into + Vector3d(q * height, 0, 0);
      return e;
    };
    Smallest last;
    ContactSet last_set;
    set = ContactSet{};
    constexpr int steps = 400;
    for (int k = 0; k <= steps; ++k) {
      const double q = static_cast<double>(k) / steps;
      const EdgeCircle e = at(q);
      findContacts(e, a.shapes, kAllContactSlots, set);
      const Smallest now = smallest(set);
      if (k % 8 == 0) {
        const double depth = overlap(e, a.shapes);
        EXPECT_TRUE(std::abs(depth) < 1e-12 || (depth > 0.0) == (now.gap < 0.0)) << i << " " << q;
      }
      if (k > 0 && now.slot >= 0 && last.slot >= 0 &&
          featureOfSlot(now.slot) != featureOfSlot(last.slot)) {
        // to the moment of the change
        double low = q - 1.0 / steps, high = q;
        for (int n = 0; n < 60; ++n) {
          const double middle = 0.5 * (low + high);
          const Smallest there = smallest(at(middle), a.shapes);
          (there.slot == last.slot ? low : high) = middle;
        }
        ContactSet before, after;
        findContacts(at(low), a.shapes, kAllContactSlots, before);
        findContacts(at(high), a.shapes, kAllContactSlots, after);
        const Smallest b = smallest(before), f = smallest(after);
        ASSERT_TRUE(b.slot >= 0 && f.slot >= 0);
        // where the nearest surface of an overlapping corner changes, gaps agree to second order
        EXPECT_NEAR(b.gap, f.gap, 1e-13 + 1e-4 * penetration) << i << " " << q;
        const ContactPoint& cb = before.slots[static_cast<std::size_t>(b.slot)];
        const ContactPoint& cf = after.slots[static_cast<std::size_t>(f.slot)];
        const bool edge =
            cb.feature == ContactFeature::kEdgeEdge || cf.feature == ContactFeature::kEdgeEdge;
        if (edge && (cb.p - cf.p).norm() < 1e-7) {
          EXPECT_LT((cb.normal - cf.normal).norm(), 1e-5)
              << i << " " << toString(cb.feature) << " to " << toString(cf.feature);
          ++changes;
        }
      }
      last = now;
    }
  }
  EXPECT_GT(changes, 10);
}

}  // namespace
}  // namespace assembly_cell
