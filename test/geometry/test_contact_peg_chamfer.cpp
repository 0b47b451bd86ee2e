// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A chamfered peg, in sharp and in chamfered holes: every feature against dense minimisation in
// extended precision, hand-overs, bounds, FCL. Thesis axes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "block_of_boxes.h"
#include "contact_approach.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

enum class WayOfPeg { kInside, kLowered, kSideways, kLeaning };

class ContactPegChamfer : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }

  // the side's radius is kRadius; every other hole is sharp
  ContactShapes shapes(int i) {
    ContactShapes s;
    s.hole_radius = kRadius + std::pow(10, uniform(-5.5, -3));
    s.peg_length = 0.06;
    s.peg_chamfer = chamferOf(std::pow(10, uniform(-4, -2.7)), uniform(0.15, 1.35));
    if (i % 2) s.chamfer = chamferOf(std::pow(10, uniform(-4, -2.7)), uniform(0.15, 1.35));
    return s;
  }

  // up to 10 mm deep in the hole, moved and tilted there; over the mouth, tilted at will, lowered,
  // or moved sideways from within it; one that leans on the mouth
  bool prepare(WayOfPeg kind, Approach& a) {
    const ContactShapes& s = a.shapes;
    const double clearance = s.hole_radius - kRadius;
    const double mouth = clearance + s.chamfer.width + s.peg_chamfer.width;
    const double where = uniform(-kPi, kPi), tilt = std::pow(10, uniform(-4, -0.7));
    const double lean = where + kPi + uniform(-1, 1);
    a.spin = uniform(-4, 4);
    a.radius = kRadius - s.peg_chamfer.width;
    if (kind == WayOfPeg::kInside) {
      a.from = {-s.peg_chamfer.height - uniform(1e-4, 0.01), 0, 0, 0, 0};
      a.way = {0, clearance * uniform(-1, 1), clearance * uniform(-1, 1),
               50 * clearance * uniform(-1, 1), 50 * clearance * uniform(-1, 1)};
      return a.findTouch();
    }
    const double offset = mouth * uniform(0, 1.3);
    a.from = {kRadius * tilt + 0.003, offset * std::cos(where), offset * std::sin(where),
              tilt * std::cos(lean), tilt * std::sin(lean)};
    a.way = {-0.003, 1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1), 0, 0};
    if (kind == WayOfPeg::kSideways) {
      a.from[0] = a.radius * std::sin(tilt) - uniform(0, s.chamfer.height + s.peg_chamfer.height);
      a.from[1] = a.from[2] = 0.0;
      a.way = {0, mouth * std::cos(where), mouth * std::sin(where), 0, 0};
    } else if (kind == WayOfPeg::kLeaning) {
      // more than its chamfer, its lower side out of the way, its side against the mouth
      const double leaning = uniform(0.1, 0.45);
      a.from = {-uniform(0, 0.006), -0.005 * std::cos(where), -0.005 * std::sin(where),
                leaning * std::cos(where), leaning * std::sin(where)};
      a.way = {0, 1e-3 * std::cos(where), 1e-3 * std::sin(where), 0, 0};
    }
    return a.findTouch();
  }
  Approach approach(int i) {
    for (;;) {
      Approach a;
      a.shapes = shapes(i / 4);
      const auto kind = static_cast<WayOfPeg>(i % 4);
      if (kind == WayOfPeg::kLeaning) {
        a.shapes.peg_chamfer = chamferOf(uniform(1e-3, 4e-3), uniform(0.15, 0.5));
        a.shapes.hole_radius = 0.032;
      }
      if (prepare(kind, a)) return a;
    }
  }

 private:
  std::mt19937_64 engine_{23};
};

// Where the bodies first touch by dense minimisation the smallest gap is zero; before, none is
// negative.
TEST_F(ContactPegChamfer, FirstTouchIsFound) {
  std::array<int, kContactSlots> met{};
  for (int i = 0; i < 600; ++i) {
    const Approach a = approach(i);
    const Smallest touch = smallest(a.at(a.touch), a.shapes);
    ASSERT_GE(touch.slot, 0) << i;
    EXPECT_NEAR(touch.gap, 0.0, 1e-15) << i << " slot " << touch.slot;
    ++met[static_cast<std::size_t>(touch.slot)];
    for (int k = 1; k < 20; ++k) {
      EXPECT_GE(smallest(a.at(a.touch * (1 - std::pow(0.6, k))), a.shapes).gap, -1e-15) << i;
    }
  }
  for (const std::size_t slot : {0, 1, 2, 5, 10, 14, 19, 21, 23, 25}) {
    EXPECT_GT(met[slot] + met[slot + 1], 2) << slot;
  }
  EXPECT_EQ(met[7], 0);
}

// Points, gaps and frames near touch, see expectMinima().
TEST_F(ContactPegChamfer, PointsAndGapsAreTheMinima) {
  std::array<int, kContactSlots> met{};
  for (int i = 0; i < 320; ++i) expectMinima(approach(i), met);
  for (const std::size_t slot : {0, 2, 5, 10, 14, 19, 21, 23, 25}) EXPECT_GT(met[slot], 8) << slot;
}

// Any pose near the mouth: bodies overlap where a gap is negative, and only there.
TEST_F(ContactPegChamfer, SignsAreThoseOfTheOverlap) {
  int overlapping = 0, apart = 0;
  for (int i = 0; i < 3000; ++i) {
    const ContactShapes s = shapes(i);
    const double reach = s.hole_radius - kRadius + s.chamfer.width + s.peg_chamfer.width;
    const double where = uniform(-kPi, kPi), tilt = std::pow(10, uniform(-5, -0.7));
    const double offset = reach * uniform(0, 1.2), r = kRadius - s.peg_chamfer.width;
    const double deep = s.chamfer.height + s.peg_chamfer.height;
    const EdgeCircle e = edgeAt({r * std::sin(tilt) - deep * uniform(-0.2, 1.3),
                                 offset * std::cos(where), offset * std::sin(where)},
                                tilt, where + kPi + uniform(-1, 1), uniform(-4, 4), r);
    const double depth = overlap(e, s);
    // shallower than any corner is thick: deep overlaps have other ways out than along a normal
    if (std::abs(depth) < 1e-13 || depth > 2e-5) continue;
    ++(depth > 0.0 ? overlapping : apart);
    const double gap = smallest(e, s).gap;
    EXPECT_EQ(depth > 0.0, gap < 0.0) << i << " overlap " << depth << ", gap " << gap;
  }
  EXPECT_GT(overlapping, 20);
  EXPECT_GT(apart, 300);
}

// From a touch straight up and out: the smallest gap has no step, and where one feature follows
// another at one place neither has the normal.
TEST_F(ContactPegChamfer, FeaturesHandOver) {
  HandOvers changes;
  for (int i = 0; i < 240; ++i) {
    const Approach a = approach(4 * (i / 2) + (i % 2 ? 0 : 2));
    const double penetration =
        std::array<double, 3>{1e-9, 1e-7, 1e-6}[static_cast<std::size_t>(i % 3)];
    const EdgeCircle start = a.at(a.touch);
    const Smallest touch = smallest(start, a.shapes);
    ContactSet set;
    findContacts(start, a.shapes, kAllContactSlots, set);
    const Vector3d normal = set.slots[static_cast<std::size_t>(touch.slot)].normal;
    // straight up, or along the generator of the peg's cone
    const double height = 1.2 * (a.shapes.chamfer.height + a.shapes.peg_chamfer.height);
    const Vector3d up(std::max(0.0, height - start.center(0)), 0, 0);
    const Vector3d out = -Vector3d(0, normal(1), normal(2)).normalized() * up(0) *
                         a.shapes.peg_chamfer.sine / a.shapes.peg_chamfer.cosine;
    const auto at = [&](double q) {
      EdgeCircle e = start;
      e.center += q * (i % 4 < 2 ? up : Vector3d(up + out)) - penetration * normal;
      return e;
    };
    followHandOver(at, a.shapes, penetration, "approach " + std::to_string(i), changes);
  }
  using F = ContactFeature;
  EXPECT_GT((changes[{F::kRimSide, F::kEdgeEdge}]) + (changes[{F::kEdgeWall, F::kEdgeEdge}]), 3);
  EXPECT_GT((changes[{F::kEdgeEdge, F::kRimCone}]), 3);
  EXPECT_GT((changes[{F::kRimCone, F::kEdgeEdge}]), 2);
}

// The clearance is a lower bound, with one chamfer or both.
TEST_F(ContactPegChamfer, ClearanceIsALowerBound) {
  int positive = 0;
  for (int i = 0; i < 400; ++i) {
    ContactShapes s = shapes(i);
    s.hole_radius = kRadius + uniform(1e-4, 2e-3);
    const EdgeCircle e =
        edgeAt({uniform(-0.01, 0.005), 1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1)},
               uniform(0, 0.1), uniform(-kPi, kPi), 0.3, kRadius - s.peg_chamfer.width);
    const double clearance = contactClearance(e, s);
    if (clearance == 0.0) continue;
    ++positive;
    for (int k = 0; k < 8; ++k) {
      EdgeCircle moved = e;
      moved.center += 0.999 * clearance * vector().normalized();
      EXPECT_LT(overlap(moved, s), 0.0) << i;
    }
  }
  EXPECT_GT(positive, 100);
}

// An upright peg that comes down beside the hole is led in by as much as both chamfers and the
// clearance make, and by no more: Whitney's range of capture.
TEST_F(ContactPegChamfer, CapturesWithinBothChamfers) {
  for (int i = 0; i < 40; ++i) {
    const ContactShapes s = shapes(i);
    const double r = kRadius - s.peg_chamfer.width;
    const double range = s.hole_radius + s.chamfer.width - r, where = uniform(-kPi, kPi);
    for (const bool inside : {true, false}) {
      const double off = range + (inside ? -1e-7 : 1e-7);
      Approach a;
      a.shapes = s;
      a.radius = r;
      a.spin = 0.2;
      a.from = {0.01, off * std::cos(where), off * std::sin(where), 0, 0};
      a.way = {-0.01, 0, 0, 0, 0};
      if (!inside) {
        EXPECT_NEAR(
            smallest(edgeAt({0, off * std::cos(where), off * std::sin(where)}, 0, 0, 0.2, r), s)
                .gap,
            0.0, 1e-15);
        continue;
      }
      // it touches below the plane or a chamfer, and is pushed towards the axis
      ASSERT_TRUE(a.findTouch()) << i;
      ContactSet set;
      findContacts(a.at(a.touch), s, kAllContactSlots, set);
      const ContactPoint& c = set.slots[static_cast<std::size_t>(smallest(set).slot)];
      EXPECT_LT(c.normal(1) * std::cos(where) + c.normal(2) * std::sin(where), -0.1) << i;
    }
  }
}

// FCL, which has bodies and no features: the peg as a stack of discs inside its cone.
bool meetsStack(const std::vector<PartShape>& block, const EdgeCircle& e, const ContactShapes& s) {
  constexpr int kDiscs = 60;
  const EdgeCircle side = shoulderOf(e, s.peg_chamfer);
  if (meet(block, side, s.peg_length - s.peg_chamfer.height)) return true;
  const double step = s.peg_chamfer.height / kDiscs;
  for (int i = 0; i < kDiscs; ++i) {
    EdgeCircle disc = e;
    disc.center += i * step * e.axis0.cross(e.axis1);
    disc.radius += s.peg_chamfer.width * i / kDiscs;
    if (meet(block, disc, step)) return true;
  }
  return false;
}

// From touch, 0.1 mm along the contact's normal either way it says free and overlapping.
TEST_F(ContactPegChamfer, FclAgreesATenthOfAMillimetreFromTouch) {
  std::array<int, kContactSlots> met{};
  for (int k = 0; k < 6; ++k) {
    ContactShapes s;
    s.hole_radius = kRadius + 6e-4;
    s.peg_length = 0.06;
    s.peg_chamfer = chamferOf(uniform(1e-3, 2e-3), uniform(0.3, 1.2));
    std::vector<PartShape> block;
    for (int i = 0; i < kBlockSides; ++i) block.push_back(boxOfRing(i, s.hole_radius, 0.0));
    for (int i = 0; i < 25; ++i) {
      Approach a;
      a.shapes = s;
      if (!prepare(i % 5 ? static_cast<WayOfPeg>(1 + i % 2) : WayOfPeg::kInside, a)) continue;
      EdgeCircle e = a.at(a.touch);
      ContactSet set;
      findContacts(e, s, kAllContactSlots, set);
      const auto slot = static_cast<std::size_t>(smallest(set).slot);
      // other contacts 0.1 mm away may be met by moving back
      const Vector3d n = set.slots[slot].normal, touch = e.center;
      e.center = touch + 1e-4 * n;
      if (overlap(e, s) > -5e-5) continue;
      ++met[slot];
      EXPECT_FALSE(meetsStack(block, e, s)) << i << " slot " << slot;
      e.center = touch - 1e-4 * n;
      EXPECT_TRUE(meetsStack(block, e, s)) << i << " slot " << slot;
    }
  }
  EXPECT_GT(met[23] + met[24], 5);
  EXPECT_GT(met[14] + met[15] + met[0] + met[1], 2);
}

}  // namespace
}  // namespace assembly_cell
