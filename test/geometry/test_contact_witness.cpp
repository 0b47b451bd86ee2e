// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Two methods that know nothing of the search: Comba's pseudo-characteristic function (thesis
// section 6.2) and FCL on a block of boxes. Thesis axes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "block_of_boxes.h"
#include "contact_reference.h"
#include "single_slot.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// Comba's function of the block: the plane's height and the hole's distance joined by the smoothing
// length t; C = −0.75 t puts its zero on the rim.
double comba(const Vec3L& p, double r_h, double t) {
  const double rho2 = static_cast<double>(p(1) * p(1) + p(2) * p(2));
  const double g1 = (r_h * r_h - rho2) / r_h, g2 = static_cast<double>(p(0));
  // a + |a|-like sum, without cancellation for negative g
  const auto part = [t](double g) {
    const double root = std::sqrt(g * g + t * t);
    return g > 0.0 ? root + g : t * t / (root - g);
  };
  const double V = part(g1) + part(g2);
  return 0.5 * (V - t * t / V) - 0.75 * t;
}

class ContactWitness : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  // leans over the hole's rim from beside it
  EdgeCircle overTheRim(double r_h) {
    const double where = uniform(-kPi, kPi), offset = uniform(2e-3, 8e-3);
    EdgeCircle e =
        edgeAt({0, offset * std::cos(where), offset * std::sin(where)}, uniform(0.03, 0.25),
               where + kPi + uniform(-0.4, 0.4), uniform(-4, 4), kRadius);
    ContactShapes s;
    s.hole_radius = r_h;
    // lowered until the first edge–edge gap is zero
    double high = edgeHeight(e).amplitude, low = -high;
    for (int i = 0; i < 60; ++i) {
      e.center(0) = 0.5 * (low + high);
      ((BodiesReference(e, s).overlap() > 0.0L) ? low : high) = e.center(0);
    }
    return e;
  }

 private:
  std::mt19937_64 engine_{21};
};

TEST_F(ContactWitness, CombaIsZeroOnRimAndFaces) {
  const double r_h = 0.0251;
  for (const double t : {1e-5, 1e-6, 1e-8}) {
    EXPECT_NEAR(comba({0, 0, static_cast<Real>(r_h)}, r_h, t), 0.0, 1e-17);
    // far from the rim the faces are where G = −0.75 t
    EXPECT_NEAR(comba({0, 0.04L, 0}, r_h, t), -0.75 * t, 1e-3 * t);
    EXPECT_NEAR(comba({-0.01L, static_cast<Real>(r_h), 0}, r_h, t), -0.75 * t, 1e-3 * t);
  }
}

// At touch its least value over the edge is zero to the smoothing length, and a Newton solve from
// the place of that value ends in the search's candidate.
TEST_F(ContactWitness, CombaLeadsToTheSameCandidates) {
  const double r_h = 0.0251;
  for (int i = 0; i < 25; ++i) {
    const EdgeCircle e = overTheRim(r_h);
    ContactShapes shapes;
    shapes.hole_radius = r_h;
    const BodiesReference b(e, shapes);
    ContactSet set;
    findContacts(e, shapes, kEdgeEdgeSlots, set);
    double last = 0.0;
    for (const double t : {1e-5, 1e-6, 1e-7}) {
      Real where = 0;
      const double least = -static_cast<double>(BodiesReference::largest(
          [&](Real at) -> Real { return -comba(b.edge(at), r_h, t); }, &where));
      EXPECT_LE(least, 1e-15);
      EXPECT_GE(least, -0.75 * t);
      // the error of the detected gap falls with t
      EXPECT_LT(-least, t < 5e-6 ? 0.3 * -last : t);
      last = least;
      double nearest = 1.0;
      for (int slot = 0; slot < 2; ++slot) {
        const ContactPoint c = findEdgeEdge(e, r_h, slot, true, static_cast<double>(where));
        const ContactPoint& known = set.slots[static_cast<std::size_t>(slot)];
        if (!c.valid || !known.valid || (c.p - b.edge(where).cast<double>()).norm() > 2e-3)
          continue;
        nearest = std::min(nearest, (c.p - known.p).norm());
      }
      EXPECT_LT(nearest, 1e-12) << i << " " << t;
    }
  }
}

std::vector<PartShape> blockOfBoxes(double r_h) {
  std::vector<PartShape> boxes;
  for (int i = 0; i < kBlockSides; ++i) boxes.push_back(boxOfRing(i, r_h, 0.0));
  return boxes;
}

// From touch, 0.1 mm along the contact's normal either way: FCL says free, and overlapping.
TEST_F(ContactWitness, FclAgreesATenthOfAMillimetreFromTouch) {
  ContactShapes s;
  s.hole_radius = kRadius + 6e-4;
  s.peg_length = 0.06;
  const std::vector<PartShape> block = blockOfBoxes(s.hole_radius);
  std::array<int, 5> met{};
  for (int i = 0; i < 120; ++i) {
    EdgeCircle e;
    Vector3d way;
    if (i % 2) {
      const double where = uniform(-kPi, kPi), offset = uniform(1e-3, 0.02);
      const bool plane = i % 4 == 3;
      e = edgeAt({0.03, offset * std::cos(where), offset * std::sin(where)}, uniform(0.05, 0.3),
                 where + (plane ? 0.0 : kPi) + uniform(-0.5, 0.5), uniform(-4, 4), kRadius);
      way = {-1, 0, 0};
    } else {
      const double where = uniform(-kPi, kPi);
      e = edgeAt({uniform(-0.02, -0.002), 0, 0}, uniform(0, 0.01), uniform(-kPi, kPi),
                 uniform(-4, 4), kRadius);
      way = {0, std::cos(where), std::sin(where)};
    }
    // closes the smallest gap along the way
    const Vector3d from = e.center;
    ContactSet set;
    const auto smallest = [&](double q) {
      e.center = from + q * way;
      ContactSet there;
      findContacts(e, s, kAllContactSlots, there);
      set = there;
      double gap = 1.0;
      for (const ContactPoint& c : there.slots) gap = c.valid ? std::min(gap, c.gap) : gap;
      return gap;
    };
    double high = 0.0;
    while (smallest(high) > 0.0 && high < 0.08) high += 1e-5;
    if (high == 0.0 || high >= 0.08) continue;
    double low = high - 1e-5;
    for (int k = 0; k < 40; ++k) {
      const double middle = 0.5 * (low + high);
      (smallest(middle) > 0.0 ? low : high) = middle;
    }
    smallest(high);
    std::size_t first = 0;
    double gap = 1.0;
    for (std::size_t k = 0; k < set.slots.size(); ++k) {
      if (set.slots[k].valid && set.slots[k].gap < gap) gap = set.slots[k].gap, first = k;
    }
    ASSERT_LT(std::abs(gap), 1e-9);
    // other contacts 0.1 mm away may be met by moving back
    if ((set.valid & (set.valid - 1)) != 0) continue;
    ++met[static_cast<std::size_t>(set.slots[first].feature)];
    const Vector3d n = set.slots[first].normal, touch = e.center;
    e.center = touch + 1e-4 * n;
    EXPECT_FALSE(meet(block, e, s.peg_length)) << i << " " << toString(set.slots[first].feature);
    e.center = touch - 1e-4 * n;
    EXPECT_TRUE(meet(block, e, s.peg_length)) << i << " " << toString(set.slots[first].feature);
  }
  for (const int n : {met[0], met[1], met[2], met[3]}) EXPECT_GT(n, 5);
}

// FCL, which knows bodies and not edges: lifted by the depth a cylinder just leaves a big box.
TEST_F(ContactWitness, DepthOnThePlaneAgreesWithFcl) {
  const double half_height = 0.03;
  PartShape block;  // top face in the plane; the hole is out of reach
  block.size = Vector3d(1, 1, 0.2);
  block.X_PS.p = Vector3d(0.5 + 0.08, 0, -0.1);
  for (int i = 0; i < 50; ++i) {
    EdgeCircle e =
        edgeAt({0, 0.3, uniform(-0.1, 0.1)}, uniform(0.05, 0.6), uniform(-kPi, kPi), 0.0, kRadius);
    const double depth = uniform(1e-4, 2e-3);
    e.center(0) = edgeHeight(e).amplitude - depth;
    const ContactPoint c = findEdgePlane(e, 0.0251);
    ASSERT_TRUE(c.valid);
    PartShape peg;
    peg.kind = PartShape::Kind::kCylinder;
    peg.size = Vector3d(2 * kRadius, 2 * kRadius, 2 * half_height);
    const Vector3d axis = fromThesisAxes(e.axis0.cross(e.axis1));
    peg.X_PS.R << fromThesisAxes(e.axis0), fromThesisAxes(e.axis1), axis;
    const Vector3d middle = fromThesisAxes(e.center) + half_height * axis;
    // FCL's search of bodies is exact to its default tolerance of 1e-6 m; a tenth of the depth
    const double margin = 1e-5;
    peg.X_PS.p = middle + Vector3d(0, 0, -c.gap - margin);
    EXPECT_TRUE(shapesMeet(peg, block)) << i;
    peg.X_PS.p = middle + Vector3d(0, 0, -c.gap + margin);
    EXPECT_FALSE(shapesMeet(peg, block)) << i;
  }
}

}  // namespace
}  // namespace assembly_cell
