// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Degenerate cases of the contact search: parallel, coaxial, touching in a line; slots, bounds, and
// smooth paths. Thesis axes.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "contact_reference.h"
#include "single_slot.h"

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

EdgeCircle pegAt(const Vector3d& center, double tilt, double lean, double spin = 0.3) {
  return edgeAt(center, tilt, lean, spin, kRadius);
}

ContactSlotMask search(const EdgeCircle& e, const ContactShapes& s, ContactSet& set) {
  return findContacts(e, s, kAllContactSlots, set);
}

class ContactDegenerate : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }

 private:
  std::mt19937_64 engine_{3};
};

// Upright in the hole against the wall: the line of contact is carried by its two ends.
TEST_F(ContactDegenerate, UprightAgainstTheWallIsALine) {
  const ContactShapes s = shapesOf(1e-4);
  for (const double tilt : {0.0, 1e-15, 1e-12, 1e-10}) {
    for (const double where : {0.0, 1.0, 2.5, -2.0}) {
      const double offset = 1e-4 + 1e-9;
      ContactSet set;
      const EdgeCircle e =
          pegAt({-0.01, offset * std::cos(where), offset * std::sin(where)}, tilt, where + 0.4);
      ASSERT_EQ(search(e, s, set), 1u << 3 | 1u << 5) << tilt;
      for (const int slot : {3, 5}) {
        const ContactPoint& c = set.slots[static_cast<std::size_t>(slot)];
        // the rim is 10 mm over the edge: they differ by the tilt times that
        EXPECT_NEAR(c.gap, -1e-9, 0.011 * tilt + 1e-15);
        EXPECT_LT((c.normal + Vector3d(0, std::cos(where), std::sin(where))).norm(),
                  1e3 * tilt + 1e-11);
        EXPECT_NEAR(c.p(0), slot == 3 ? -0.01 : 0.0, 1e-10);
      }
    }
  }
}

// Coaxial and upright there is no place to touch at; with clearance nor is there one nearby.
TEST_F(ContactDegenerate, CoaxialUprightHasNoContactPoint) {
  for (const double clearance : {0.0, 1e-9, 1e-4}) {
    for (const double height : {-0.01, -1e-6, 0.0}) {
      ContactSet set;
      EXPECT_EQ(search(pegAt({height, 0, 0}, 0, 0), shapesOf(clearance), set), 0u)
          << clearance << " " << height;
      EXPECT_EQ(search(pegAt({height, 1e-17, 0}, 0, 0), shapesOf(clearance), set), 0u);
    }
  }
}

// Zero clearance: the least offset is an overlap of that size, the least tilt one of its square.
TEST_F(ContactDegenerate, ZeroClearance) {
  const ContactShapes s = shapesOf(0.0);
  for (const double offset : {1e-12, 1e-9, 1e-6}) {
    ContactSet set;
    const EdgeCircle e = pegAt({-0.01, 0, offset}, 0.0, 0.0);
    EXPECT_EQ(search(e, s, set), 1u << 3 | 1u << 5);
    EXPECT_NEAR(set.slots[3].gap, -offset, 1e-16);
    EXPECT_NEAR(set.slots[5].gap, -offset, 1e-16);
  }
  // tilted about the rim's centre: the rim digs into both sides by r (1 − cos), the edge bears on
  // both sides of the major axis at gap 0
  for (const double tilt : {1e-6, 1e-4, 1e-2}) {
    ContactSet set;
    EdgeCircle e = pegAt(Vector3d::Zero(), tilt, 0.7);
    e.center = -0.01 * e.axis0.cross(e.axis1);
    const ContactSlotMask valid = search(e, s, set);
    EXPECT_EQ(valid & kRimSideSlots, kRimSideSlots & kSharpRimSlots) << tilt;
    for (const std::size_t slot : {5u, 6u}) {
      EXPECT_NEAR(set.slots[slot].gap, -kRadius * (1 - std::cos(tilt)), 1e-15);
    }
    EXPECT_GT((set.slots[5].p - set.slots[6].p).norm(), 1.9 * kRadius);
  }
}

// Both sides at once: a peg tilted until its sides bear on opposite places of the rim, and turned
// further until wall and rim hold it crosswise.
TEST_F(ContactDegenerate, JammedPegTouchesOnOppositeSides) {
  const double clearance = 5e-5;
  const ContactShapes s = shapesOf(clearance);
  // axis through the rim's centre: two rim_side contacts where cos(tilt) = r_p / r_h
  const double tilt = std::acos(kRadius / s.hole_radius);
  EdgeCircle e = pegAt(Vector3d::Zero(), tilt, 0.7);
  e.center = -1e-4 * e.axis0.cross(e.axis1);
  ContactSet set;
  const ContactSlotMask valid = search(e, s, set);
  int sides = 0;
  for (const std::size_t slot : {5u, 6u}) {
    if (!set.slots[slot].valid) continue;
    EXPECT_NEAR(set.slots[slot].gap, 0.0, 1e-15);
    ++sides;
  }
  // the side that leans down meets the rim over the bottom edge, the other at the edge or above
  EXPECT_GE(sides, 1) << valid;

  // bottom edge on the wall on one side, rim on the other
  const double small = 2e-3, deep = 2 * clearance / small;
  EdgeCircle cross = pegAt({-deep, 0, 0}, small, 0.0);
  cross.center(1) = -(clearance - 1e-7);
  findContacts(cross, s, kAllContactSlots, set);
  EXPECT_TRUE(set.valid & kEdgeWallSlots && set.valid & kRimSideSlots);
}

// The floor takes the lowest point where it lies in the hole.
TEST_F(ContactDegenerate, FloorOfAFiniteHole) {
  ContactShapes s = shapesOf(1e-3);
  s.hole_depth = 0.012;
  for (const double tilt : {0.0, 1e-12, 1e-3, 0.03}) {
    EdgeCircle e = pegAt({0, 1e-5, 2e-5}, tilt, 1.0);
    e.center(0) = edgeHeight(e).amplitude - s.hole_depth - 1e-7;
    ContactSet set;
    ASSERT_TRUE(search(e, s, set) & kEdgePlaneSlots) << tilt;
    EXPECT_NEAR(set.slots[2].gap, -1e-7, 1e-15);
    EXPECT_NEAR(set.slots[2].rim(0), -s.hole_depth, 1e-15);
    EXPECT_EQ(set.slots[2].normal, Vector3d::UnitX());
    // unlimited depth: nothing there
    EXPECT_FALSE(search(e, shapesOf(1e-3), set) & kEdgePlaneSlots);
  }
}

TEST_F(ContactDegenerate, TopEdgeIsReported) {
  const ContactShapes s = shapesOf(1e-4);
  ContactSet set;
  search(pegAt({-0.0599, 1e-4, 0}, 0.0, 0.0), s, set);
  EXPECT_TRUE(set.valid & kRimSideSlots);
  EXPECT_FALSE(set.top_reached);
  search(pegAt({-0.0601, 1e-4, 0}, 0.0, 0.0), s, set);
  EXPECT_FALSE(set.valid & kRimSideSlots);
  EXPECT_TRUE(set.top_reached);
}

// The face over the rim: under the lean's rim point, and never without the edge on the plane.
TEST_F(ContactDegenerate, FaceOverTheRimNeverTouchesFirst) {
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    const double lean = uniform(-kPi, kPi);
    EdgeCircle e = pegAt({0, uniform(-0.03, 0.03), uniform(-0.03, 0.03)}, uniform(1e-4, 0.4), lean);
    const ContactShapes s = shapesOf(uniform(0, 1e-3));
    const double along = std::cos(lean) * e.center(1) + std::sin(lean) * e.center(2);
    const double slope = edgeHeight(e).amplitude / kRadius;
    e.center(0) = slope / std::sqrt(1 - slope * slope) * (s.hole_radius - along);
    ContactSet set;
    search(e, s, set);
    if (!set.slots[7].valid) continue;
    ++seen;
    EXPECT_NEAR(set.slots[7].gap, 0.0, 1e-15);
    EXPECT_LE(edgeHeight(e).lowest(), 1e-15);
    const Vector3d lowest = set.slots[2].p;
    EXPECT_TRUE(set.slots[2].valid);
    EXPECT_GE(std::hypot(lowest(1), lowest(2)), s.hole_radius - 1e-15);
  }
  EXPECT_GT(seen, 1000);
}

// Bad numbers find nothing; the set stays usable.
TEST_F(ContactDegenerate, NotFiniteFindsNothing) {
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity(),
                        -std::numeric_limits<double>::infinity()};
  const EdgeCircle good = pegAt({-0.01, 1e-4, 0}, 1e-4, 1.0);
  const ContactShapes s = shapesOf(1e-4);
  for (const double value : bad) {
    for (int i = 0; i < 9; ++i) {
      EdgeCircle e = good;
      (i < 3 ? e.center : i < 6 ? e.axis0 : e.axis1)(i % 3) = value;
      ContactSet set;
      search(good, s, set);
      search(e, s, set);
      for (const ContactPoint& c : set.slots) {
        EXPECT_FALSE(c.valid && !std::isfinite(c.gap)) << value << " " << i;
      }
      EXPECT_NE(search(good, s, set), 0u);
    }
  }
}

// Slots keep their places: a peg that rolls round the hole's wall stays in the slots it started in,
// through the direction of its lean.
TEST_F(ContactDegenerate, SlotsFollowTheirPlaces) {
  const ContactShapes s = shapesOf(1e-4);
  ContactSet set;
  ContactSlotMask first = 0;
  for (int k = 0; k <= 2000; ++k) {
    const double where = 4 * kPi * k / 2000;
    const EdgeCircle e = pegAt({-0.01, 1e-4 * std::cos(where), 1e-4 * std::sin(where)}, 1e-4, 0.3);
    const ContactSlotMask valid = search(e, s, set) & (kEdgeWallSlots | kRimSideSlots);
    if (k == 0) first = valid;
    EXPECT_EQ(valid, first) << k;
    const ContactPoint& c = set.slots[3];
    // the ellipse turns the place by r tilt²/offset = 2.5 µrad
    EXPECT_LT((c.normal + Vector3d(0, std::cos(where), std::sin(where))).norm(), 1e-5);
  }
  // mirrored pegs take mirrored places
  for (int i = 0; i < 300; ++i) {
    const EdgeCircle e = pegAt({-0.01, uniform(-2e-4, 2e-4), uniform(-2e-4, 2e-4)},
                               uniform(0, 0.02), uniform(-kPi, kPi), uniform(-kPi, kPi));
    const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
    const EdgeCircle image{mirror * e.center, mirror * e.axis0, mirror * -e.axis1, e.radius};
    ContactSet a, b;
    search(e, s, a);
    search(image, s, b);
    ASSERT_EQ(a.valid & ~kEdgeEdgeSlots, b.valid & ~kEdgeEdgeSlots);
    for (std::size_t slot = 2; slot < 8; ++slot) {
      if (!a.slots[slot].valid) continue;
      EXPECT_NEAR(a.slots[slot].gap, b.slots[slot].gap, 1e-16) << slot;
      EXPECT_LT((mirror * a.slots[slot].p - b.slots[slot].p).norm(), 1e-9) << slot;
    }
  }
}

// Smooth random motions near touch: each slot's gap changes by what its point moves, the smallest
// gap never jumps, warm and cold searches agree.
TEST_F(ContactDegenerate, GapsAreContinuousAlongPaths) {
  int compared = 0, agreed = 0;
  for (int i = 0; i < 400; ++i) {
    const bool inside = i % 2 == 0;
    const double clearance = std::pow(10, uniform(-5.5, -3));
    const ContactShapes s = shapesOf(clearance);
    const double where = uniform(-kPi, kPi);
    EdgeCircle start = pegAt(Vector3d::Zero(), 0, 0);
    if (inside) {
      const double offset = clearance * uniform(0.5, 1);
      start = pegAt({uniform(-0.01, -1e-4), offset * std::cos(where), offset * std::sin(where)},
                    clearance * uniform(0, 20), uniform(-kPi, kPi), uniform(-4, 4));
    } else {
      const double offset = uniform(1e-3, 8e-3);
      start = pegAt({0, offset * std::cos(where), offset * std::sin(where)}, uniform(0.01, 0.2),
                    where + kPi + uniform(-0.5, 0.5), uniform(-4, 4));
      ContactSet set;
      start.center(0) = edgeHeight(start).amplitude;
      while (!search(start, s, set)) start.center(0) -= 1e-5;
    }
    const double scale = std::min(1e-5, 0.1 * clearance);
    const Vector3d velocity = scale * vector(), swing = scale * vector();
    const Vector3d axis = vector().normalized();
    const double turn = 40 * scale * uniform(-1, 1);
    const auto at = [&](double q) {
      const Matrix3d R = AngleAxisd(turn * std::sin(3 * q), axis).toRotationMatrix();
      EdgeCircle e = start;
      e.center += velocity * q + swing * std::sin(5 * q);
      e.axis0 = R * e.axis0;
      e.axis1 = R * e.axis1;
      return e;
    };
    ContactSet set, last;
    constexpr int steps = 500;
    // of any point of the bottom or within 40 mm of it, per step
    const double travel =
        1.05 * (velocity.norm() + 5 * swing.norm() + 0.04 * 3 * std::abs(turn)) * 2 / steps;
    for (int k = 0; k <= steps; ++k) {
      const EdgeCircle e = at(2.0 * k / steps);
      search(e, s, set);
      double gap = s.reach, before = s.reach;
      for (std::size_t slot = 0; slot < set.slots.size(); ++slot) {
        if (set.slots[slot].valid) gap = std::min(gap, set.slots[slot].gap);
        if (k > 0 && last.slots[slot].valid) before = std::min(before, last.slots[slot].gap);
        if (k == 0 || !set.slots[slot].valid || !last.slots[slot].valid) continue;
        const ContactPoint &a = set.slots[slot], &b = last.slots[slot];
        // another place may have been found in a slot that was given up
        if ((a.p - b.p).norm() > 1e-3) continue;
        EXPECT_LE(std::abs(a.gap - b.gap), travel) << i << " " << k << " slot " << slot;
        ++compared;
      }
      // as long as the overlap is shallow; deep corners change their nearest way out
      if (k > 0 && std::min(gap, before) > -1e-5) {
        EXPECT_LE(std::abs(gap - before), travel) << i << " " << k;
      }
      ContactSet cold;
      search(e, s, cold);
      double cold_gap = s.reach;
      for (const ContactPoint& c : cold.slots) {
        if (c.valid) cold_gap = std::min(cold_gap, c.gap);
      }
      EXPECT_NEAR(gap, cold_gap, 1e-13) << i << " " << k;
      ++agreed;
      last = set;
    }
  }
  EXPECT_GT(compared, 50000);
  EXPECT_EQ(agreed, 400 * 501);
}

// The clearance is a lower bound: no motion shorter than it makes the bodies touch.
TEST_F(ContactDegenerate, ClearanceIsALowerBound) {
  int positive = 0;
  for (int i = 0; i < 400; ++i) {
    ContactShapes s = shapesOf(uniform(1e-4, 2e-3));
    if (i % 3 == 0) s.hole_depth = 0.02;
    const bool inside = i % 2 == 0;
    const EdgeCircle e = pegAt({inside ? uniform(-0.019, 0) : uniform(0, 0.01),
                                1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1)},
                               uniform(0, inside ? 0.05 : 0.3), uniform(-kPi, kPi));
    const double clearance = contactClearance(e, s);
    ASSERT_GE(clearance, 0.0);
    if (clearance == 0.0) continue;
    ++positive;
    for (int k = 0; k < 8; ++k) {
      EdgeCircle moved = e;
      moved.center += 0.999 * clearance * vector().normalized();
      EXPECT_LT(BodiesReference(moved, s).overlap(), 0.0L) << i;
    }
  }
  EXPECT_GT(positive, 100);
}

TEST_F(ContactDegenerate, CoaxialEqualCirclesHaveNoContactPoint) {
  const EdgeCircle e = edgeAt(Eigen::Vector3d::Zero(), 0, 0, 0, kRadius);
  for (int slot = 0; slot < 2; ++slot) {
    EXPECT_FALSE(findEdgeEdge(e, kRadius, slot, false, 0).valid);
    EXPECT_FALSE(findEdgeEdge(e, kRadius, slot, true, 1.0).valid);
  }
  EXPECT_FALSE(findEdgePlane(e, kRadius).valid);
}

}  // namespace
}  // namespace assembly_cell
