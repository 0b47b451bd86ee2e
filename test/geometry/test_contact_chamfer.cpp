// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A chamfered hole: every feature against dense minimisation in extended precision, hand-overs,
// bounds, FCL. Thesis axes.
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

ContactShapes chamferedShapes(double clearance, double width, double angle) {
  ContactShapes s;
  s.hole_radius = kRadius + clearance;
  s.peg_length = 0.06;
  s.chamfer = chamferOf(width, angle);
  return s;
}

enum class Way { kInside, kLowered, kSideways, kLeaning };

class ContactChamfer : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }

  ContactShapes shapes() {
    return chamferedShapes(std::pow(10, uniform(-5.5, -3)), std::pow(10, uniform(-4, -2.7)),
                           uniform(0.15, 1.35));
  }

  // up to 10 mm deep in the hole, moved and tilted there; a peg over the chamfer, tilted at will,
  // that is lowered, or moved sideways from within its mouth; one that leans on the mouth
  bool prepare(Way kind, Approach& a) {
    const double clearance = a.shapes.hole_radius - kRadius, width = a.shapes.chamfer.width;
    const double where = uniform(-kPi, kPi), tilt = std::pow(10, uniform(-4, -0.7));
    const double lean = where + kPi + uniform(-1, 1);
    a.spin = uniform(-4, 4);
    if (kind == Way::kInside) {
      a.from = {-uniform(1e-4, 0.01), 0, 0, 0, 0};
      a.way = {0, clearance * uniform(-1, 1), clearance * uniform(-1, 1),
               50 * clearance * uniform(-1, 1), 50 * clearance * uniform(-1, 1)};
      return a.findTouch();
    }
    const double offset = (clearance + width) * uniform(0, 1.3);
    a.from = {kRadius * tilt + 0.003, offset * std::cos(where), offset * std::sin(where),
              tilt * std::cos(lean), tilt * std::sin(lean)};
    a.way = {-0.003, 1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1), 0, 0};
    if (kind == Way::kSideways) {
      a.from[0] = kRadius * std::sin(tilt) - uniform(0, a.shapes.chamfer.height);
      a.from[1] = a.from[2] = 0.0;
      a.way = {0, width * std::cos(where), width * std::sin(where), 0, 0};
    } else if (kind == Way::kLeaning) {
      // its lower side out of the way, its side against the mouth
      const double leaning = std::min(0.45, a.shapes.chamfer.height > 0 ? uniform(0.1, 0.45) : 0);
      a.from = {-uniform(0, 0.006), -0.005 * std::cos(where), -0.005 * std::sin(where),
                leaning * std::cos(where), leaning * std::sin(where)};
      a.way = {0, 1e-3 * std::cos(where), 1e-3 * std::sin(where), 0, 0};
    }
    return a.findTouch();
  }
  Approach approach(Way kind) {
    for (;;) {
      Approach a;
      a.shapes = shapes();
      if (kind == Way::kLeaning) {
        // a wide mouth that a thinner peg leans in
        a.radius = 0.018;
        a.shapes.chamfer = chamferOf(uniform(1e-3, 4e-3), uniform(0.15, 0.5));
      }
      if (prepare(kind, a)) return a;
    }
  }

 private:
  std::mt19937_64 engine_{17};
};

// Where the bodies first touch by dense minimisation the smallest gap is zero; before, none is
// negative. Each feature at each edge is met first but the two that never are.
TEST_F(ContactChamfer, FirstTouchIsFound) {
  std::array<int, kContactSlots> met{};
  for (int i = 0; i < 400; ++i) {
    const Approach a = approach(static_cast<Way>(i % 4));
    const Smallest touch = smallest(a.at(a.touch), a.shapes);
    ASSERT_GE(touch.slot, 0) << i;
    EXPECT_NEAR(touch.gap, 0.0, 1e-15) << i << " slot " << touch.slot;
    ++met[static_cast<std::size_t>(touch.slot)];
    for (int k = 1; k < 20; ++k) {
      EXPECT_GE(smallest(a.at(a.touch * (1 - std::pow(0.6, k))), a.shapes).gap, -1e-15) << i;
    }
  }
  for (const std::size_t slot : {0, 1, 2, 3, 5, 8, 9, 10, 12}) EXPECT_GT(met[slot], 2) << slot;
  EXPECT_EQ(met[7], 0);
}

// Points, gaps and frames near touch, see expectMinima().
TEST_F(ContactChamfer, PointsAndGapsAreTheMinima) {
  std::array<int, kContactSlots> met{};
  for (int i = 0; i < 240; ++i) expectMinima(approach(static_cast<Way>(i % 4)), met);
  for (const std::size_t slot : {0, 1, 2, 3, 5, 8, 9, 10, 12}) EXPECT_GT(met[slot], 8) << slot;
}

// Any pose near the chamfer: bodies overlap where a gap is negative, and only there.
TEST_F(ContactChamfer, SignsAreThoseOfTheOverlap) {
  int overlapping = 0, apart = 0;
  for (int i = 0; i < 3000; ++i) {
    const ContactShapes s = shapes();
    const double reach = s.hole_radius - kRadius + s.chamfer.width;
    const double where = uniform(-kPi, kPi), tilt = std::pow(10, uniform(-5, -0.7));
    const double offset = reach * uniform(0, 1.2);
    const EdgeCircle e = edgeAt({kRadius * std::sin(tilt) - s.chamfer.height * uniform(-0.2, 1.3),
                                 offset * std::cos(where), offset * std::sin(where)},
                                tilt, where + kPi + uniform(-1, 1), uniform(-4, 4), kRadius);
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

// A peg that stands nearly upright and overlaps the rim by ten micrometres, lowered past it:
// chamfer or plane, edge and wall hand over, and the peg is never without a contact.
TEST_F(ContactChamfer, AnUprightPegPassesTheRim) {
  struct Case {
    double clearance, width, angle, tilt, beside, lean;
  };
  // one without a chamfer, then every angle; clearances down to a few micrometres
  for (const Case& c : {Case{9.3e-5, 0.0, 0.0, 1.69e-3, 1.08e-4, 0.011},
                        Case{7.05e-4, 1.23e-4, 0.988, 7.15e-5, 7.18e-4, -0.144},
                        Case{4.4e-6, 1.6e-4, 0.896, 6e-5, 2.27e-5, -0.438},
                        Case{1.09e-4, 1.39e-4, 0.672, 1.1e-5, 1.19e-4, 0.163},
                        Case{8.6e-6, 1.6e-4, 1.3, 2e-5, 1.78e-5, -0.3},
                        Case{5.2e-5, 3.4e-4, 0.3, 3.3e-5, 6.2e-5, 0.5}}) {
    ContactShapes s = chamferedShapes(c.clearance, c.width, c.angle);
    if (c.width == 0.0) s.chamfer = {};
    int at_wall = 0, above = 0;
    double before = 0.0;
    for (double under = -5e-6; under < 6e-5; under += 2e-7) {
      const double lowest =
          c.width > 0.0 ? -s.chamfer.height - under : -2 * kRadius * std::sin(c.tilt) - under;
      const EdgeCircle e = edgeAt({lowest + kRadius * std::sin(c.tilt), c.beside, 0.0}, c.tilt,
                                  kPi + c.lean, 0.3, kRadius);
      const Smallest found = smallest(e, s);
      const double depth = overlap(e, s);
      ASSERT_GE(found.slot, 0) << c.clearance << ' ' << c.angle << ": none " << under
                               << " under the rim, overlap " << depth;
      EXPECT_EQ(depth > 0.0, found.gap < 0.0) << c.clearance << ' ' << c.angle << ' ' << under;
      // a step of 0.2 um changes no depth by more; a contact takes over within a tenth of it
      if (under > -5e-6) {
        EXPECT_LT(std::abs(found.gap - before), 4e-7 + 0.1 * std::max(depth, 0.0))
            << c.clearance << ' ' << c.angle << ' ' << under;
      }
      before = found.gap;
      ++(featureOfSlot(found.slot) == ContactFeature::kEdgeWall ? at_wall : above);
    }
    EXPECT_GT(at_wall, 50) << c.clearance << ' ' << c.angle;
    EXPECT_GT(above, 10) << c.clearance << ' ' << c.angle;
  }
}

// From a touch in the hole up and out, and from there over the mouth outwards: the smallest gap has
// no step, and where one feature follows another at one place neither has the normal.
TEST_F(ContactChamfer, FeaturesHandOver) {
  HandOvers changes;
  for (int i = 0; i < 160; ++i) {
    const Approach a = approach(i % 2 ? Way::kInside : Way::kSideways);
    const double penetration =
        std::array<double, 3>{1e-9, 1e-7, 1e-6}[static_cast<std::size_t>(i % 3)];
    const EdgeCircle start = a.at(a.touch);
    const Smallest touch = smallest(start, a.shapes);
    ContactSet set;
    findContacts(start, a.shapes, kAllContactSlots, set);
    const Vector3d normal = set.slots[static_cast<std::size_t>(touch.slot)].normal;
    // straight up, or along the cone's generator
    const Vector3d up(1.2 * a.shapes.chamfer.height - start.center(0), 0, 0);
    const Vector3d out = -Vector3d(0, normal(1), normal(2)).normalized() * up(0) *
                         a.shapes.chamfer.sine / a.shapes.chamfer.cosine;
    const auto at = [&](double q) {
      EdgeCircle e = start;
      e.center += q * (i % 4 < 2 ? up : Vector3d(up + out)) - penetration * normal;
      return e;
    };
    followHandOver(at, a.shapes, penetration, "approach " + std::to_string(i), changes);
  }
  using F = ContactFeature;
  EXPECT_GT((changes[{F::kEdgeWall, F::kEdgeEdge}]), 3);
  EXPECT_GT((changes[{F::kEdgeEdge, F::kEdgeCone}]), 3);
  EXPECT_GT((changes[{F::kEdgeCone, F::kEdgeEdge}]), 3);
}

// The clearance is a lower bound beside a chamfer, too.
TEST_F(ContactChamfer, ClearanceIsALowerBound) {
  int positive = 0;
  for (int i = 0; i < 400; ++i) {
    ContactShapes s =
        chamferedShapes(uniform(1e-4, 2e-3), uniform(1e-4, 2e-3), uniform(0.15, 1.35));
    const EdgeCircle e =
        edgeAt({uniform(-0.01, 0.005), 1e-3 * uniform(-1, 1), 1e-3 * uniform(-1, 1)},
               uniform(0, 0.1), uniform(-kPi, kPi), 0.3, kRadius);
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

// An edge that lies in the cone, held at two opposite places: both are found, from any start.
TEST_F(ContactChamfer, TwoPlacesOfATiltedEdge) {
  for (const double tilt : {1e-4, 1e-3, 1e-2}) {
    const ContactShapes s = chamferedShapes(1e-6, 1e-3, 0.7);
    // moved against its tilt until both sides are equally high over the cone
    const auto difference = [&](double x, ContactSet& set) {
      EdgeCircle e = edgeAt({0, x, 0}, tilt, 0.0, 0.4, kRadius);
      e.center(0) = -0.5 * s.chamfer.height;
      set = ContactSet{};
      ContactShapes far = s;
      far.reach = 1e-3;
      findContacts(e, far, kEdgeConeSlots, set);
      return e;
    };
    ContactSet set;
    const double x = -kRadius * std::sin(tilt) * std::tan(0.7);
    const EdgeCircle e = difference(x, set);
    ASSERT_EQ(set.valid, kEdgeConeSlots & possibleSlots(s)) << tilt;
    EXPECT_NEAR(set.slots[10].gap, set.slots[11].gap, 1e-2 * kRadius * tilt);
    EXPECT_GT((set.slots[10].p - set.slots[11].p).norm(), 1.5 * kRadius);
    const BodiesReference b(e, s);
    EXPECT_NEAR(set.slots[10].gap,
                -static_cast<double>(BodiesReference::largest(
                    [&](Real t) -> Real { return -b.coneHeight(b.edge(t)); })),
                1e-15);
  }
}

// The block as rings of boxes: under the face around the mouth, around the bore, and one along each
// generator of the cone; 360 sides, at their corners 1 µm outside.
std::vector<PartShape> chamferedBlock(const ContactShapes& s) {
  constexpr int n = kBlockSides;
  const double mouth = s.hole_radius + s.chamfer.width, h = s.chamfer.height;
  std::vector<PartShape> boxes;
  for (int i = 0; i < n; ++i) {
    boxes.push_back(boxOfRing(i, mouth, 0.0));
    boxes.push_back(boxOfRing(i, s.hole_radius, -h));
    PartShape slope;
    const double thickness = s.chamfer.width * s.chamfer.cosine;
    const Eigen::Matrix3d round =
        Eigen::AngleAxisd(2 * kPi * i / n, Vector3d::UnitZ()).toRotationMatrix();
    // x into the block, z up along the generator
    Eigen::Matrix3d along;
    along << s.chamfer.cosine, 0, s.chamfer.sine, 0, 1, 0, -s.chamfer.sine, 0, s.chamfer.cosine;
    slope.size =
        Vector3d(thickness, 2 * s.hole_radius * std::tan(kPi / n), std::hypot(s.chamfer.width, h));
    slope.X_PS.R = round * along;
    slope.X_PS.p = round * (Vector3d(s.hole_radius + 0.5 * s.chamfer.width, 0, -0.5 * h) +
                            along * Vector3d(0.5 * thickness, 0, 0));
    boxes.push_back(slope);
  }
  return boxes;
}

// From touch, 0.1 mm along the contact's normal in both directions: FCL, which has bodies and no
// features, finds free and overlapping.
TEST_F(ContactChamfer, FclAgreesATenthOfAMillimetreFromTouch) {
  std::array<int, kContactSlots> met{};
  for (int k = 0; k < 6; ++k) {
    const ContactShapes s = chamferedShapes(6e-4, uniform(1e-3, 2e-3), uniform(0.3, 1.2));
    const std::vector<PartShape> block = chamferedBlock(s);
    for (int i = 0; i < 25; ++i) {
      Approach a;
      a.shapes = s;
      if (!prepare(i % 5 ? static_cast<Way>(1 + i % 2) : Way::kInside, a)) continue;
      EdgeCircle e = a.at(a.touch);
      ContactSet set;
      findContacts(e, s, kAllContactSlots, set);
      const auto slot = static_cast<std::size_t>(smallest(set).slot);
      // other contacts 0.1 mm away may be met by moving back
      const Vector3d n = set.slots[slot].normal, touch = e.center;
      e.center = touch + 1e-4 * n;
      if (overlap(e, s) > -2e-5) continue;
      ++met[slot];
      EXPECT_FALSE(meet(block, e, s.peg_length)) << i << " slot " << slot;
      e.center = touch - 1e-4 * n;
      EXPECT_TRUE(meet(block, e, s.peg_length)) << i << " slot " << slot;
    }
  }
  EXPECT_GT(met[10], 5);
  EXPECT_GT(met[0] + met[1], 5);
}

}  // namespace
}  // namespace assembly_cell
