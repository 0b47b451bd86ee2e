// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A bore that leans, against samples of the edge and against differences. Thesis axes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "contact_reference.h"

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

class LeaningBore : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  ContactShapes shapes(double reach) {
    ContactShapes s;
    s.hole_radius = kRadius + uniform(5e-5, 5e-4);
    s.peg_length = 0.06;
    s.reach = reach;
    const double where = uniform(-kPi, kPi), lean = uniform(1e-3, 2e-2);
    s.bore_lean = lean * Vector2d(std::cos(where), std::sin(where));
    return s;
  }
  // somewhere in the bore, near its wall
  EdgeCircle inside(const ContactShapes& s) {
    const double depth = uniform(0.005, 0.02), where = uniform(-kPi, kPi);
    const double offset = uniform(0.5, 1.5) * (s.hole_radius - kRadius);
    const Vector2d at = -depth * s.bore_lean + offset * Vector2d(std::cos(where), std::sin(where));
    return edgeAt({-depth, at.x(), at.y()}, uniform(0.001, 0.03), uniform(-kPi, kPi),
                  uniform(-kPi, kPi), kRadius);
  }
  static Vector3d edge(const EdgeCircle& e, double t) {
    return e.center + e.radius * (std::cos(t) * e.axis0 + std::sin(t) * e.axis1);
  }
  // radius of the level circle through p about the bore's axis
  static double rho(const ContactShapes& s, const Vector3d& p) {
    return (p.tail<2>() - p(0) * s.bore_lean).norm();
  }

  std::mt19937_64 engine_{7};
};

TEST_F(LeaningBore, WallIsMetWhereTheEdgeComesNearest) {
  int compared = 0;
  for (int i = 0; i < 300; ++i) {
    const ContactShapes s = shapes(3e-4);
    const EdgeCircle e = inside(s);
    double farthest = 0.0;
    constexpr int n = 20000;
    for (int k = 0; k < n; ++k) farthest = std::max(farthest, rho(s, edge(e, 2 * kPi * k / n)));
    ContactSet set;
    findContacts(e, s, kEdgeWallSlots, set);
    double least = 1.0;
    for (const std::size_t slot : {3u, 4u}) {
      if (!(set.valid >> slot & 1u)) continue;
      const ContactPoint& c = set.slots[slot];
      EXPECT_LT((c.p - edge(e, c.t)).norm(), 1e-14);
      EXPECT_NEAR(rho(s, c.rim), s.hole_radius, 1e-14);
      EXPECT_NEAR(c.rim(0), c.p(0), 1e-15);
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-14);
      EXPECT_NEAR(c.normal.dot(c.p - c.rim), c.gap, 1e-14);
      // the wall's own line through the place, along the bore, lies in the wall
      EXPECT_NEAR(c.normal.dot(Vector3d(1.0, s.bore_lean(0), s.bore_lean(1))), 0.0, 1e-14);
      least = std::min(least, c.gap * std::sqrt(1 + std::pow(c.normal(0), 2)));
    }
    if (s.hole_radius - farthest > 4e-4) continue;
    ASSERT_LT(least, 1.0);
    // samples miss the farthest place by r (pi/n)²/2; lengths by the square of the lean
    EXPECT_NEAR(least, s.hole_radius - farthest, 4e-10 + 4e-4 * std::abs(least));
    ++compared;
  }
  EXPECT_GT(compared, 200);
}

// By differences of an accelerated motion, of the level distance from the wall: the gap without the
// length of its normal, which is one but for the square of the lean.
TEST_F(LeaningBore, WallsRatesAreThoseOfTheGap) {
  int compared = 0;
  for (int i = 0; i < 600; ++i) {
    const ContactShapes s = shapes(4e-4);
    const EdgeCircle start = inside(s);
    const auto vector = [this] { return Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)); };
    const Vector3d velocity = 0.03 * vector(), acceleration = vector();
    const Vector3d axis = vector().normalized();
    const double rate = uniform(-1, 1), angular = uniform(-10, 10);
    const auto at = [&](double t) {
      const Matrix3d R = AngleAxisd(rate * t + 0.5 * angular * t * t, axis).toRotationMatrix();
      return EdgeCircle{start.center + velocity * t + 0.5 * acceleration * t * t, R * start.axis0,
                        R * start.axis1, start.radius};
    };
    ContactSet first;
    findContacts(start, s, kEdgeWallSlots, first);
    for (const std::size_t slot : {3u, 4u}) {
      if (!(first.valid >> slot & 1u)) continue;
      const auto differences = [&](double h, double& speed, double& change) {
        double g[5];
        for (int k = 0; k < 5; ++k) {
          ContactSet set = first;
          if (!(findContacts(at(h * (k - 2)), s, first.valid, set) >> slot & 1u)) return false;
          g[k] = set.slots[slot].gap / set.slots[slot].normal.tail<2>().norm();
        }
        speed = (g[0] - 8 * g[1] + 8 * g[3] - g[4]) / (12 * h);
        change = (-g[0] + 16 * g[1] - 30 * g[2] + 16 * g[3] - g[4]) / (12 * h * h);
        return true;
      };
      double coarse_speed, coarse, speed, change;
      if (!differences(2e-4, coarse_speed, coarse) || !differences(1e-4, speed, change)) continue;
      const double error = std::abs(coarse - change) / 2 + 1e-7;
      if (error > 1e-3) continue;
      const ContactPoint& c = first.slots[slot];
      const Vector3d omega = rate * axis, r = c.p - start.center;
      const Vector3d v_m = velocity + omega.cross(r);
      const Vector3d a_m = acceleration + (angular * axis).cross(r) + omega.cross(omega.cross(r));
      const ContactRates rates = contactRates(start, c, v_m, omega);
      const double level = c.normal.tail<2>().norm();
      EXPECT_NEAR(speed, c.normal.dot(v_m) / level, std::abs(coarse_speed - speed) / 5 + 1e-10);
      EXPECT_NEAR(change, (c.normal.dot(a_m) + rates.gap_bias) / level, error);
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

// The cone's level circles lean with the bore: the place is where the edge comes nearest to it.
TEST_F(LeaningBore, ChamferLeansWithTheBore) {
  int compared = 0;
  for (int i = 0; i < 400; ++i) {
    ContactShapes s = shapes(3e-4);
    s.chamfer = chamferOf(uniform(5e-4, 2e-3), uniform(0.3, 1.2));
    const double where = uniform(-kPi, kPi), height = -s.chamfer.height * uniform(0.2, 0.8);
    const double out =
        s.hole_radius - kRadius + (height + s.chamfer.height) * s.chamfer.sine / s.chamfer.cosine;
    const Vector2d at = height * s.bore_lean + out * Vector2d(std::cos(where), std::sin(where));
    const EdgeCircle e = edgeAt({height, at.x(), at.y()}, uniform(1e-4, 3e-3), uniform(-kPi, kPi),
                                uniform(-kPi, kPi), kRadius);
    const double mouth = s.hole_radius + s.chamfer.width;
    const auto over = [&](const Vector3d& p) {
      return s.chamfer.cosine * (mouth - rho(s, p)) + s.chamfer.sine * p(0);
    };
    double lowest = 1.0;
    constexpr int n = 20000;
    for (int k = 0; k < n; ++k) lowest = std::min(lowest, over(edge(e, 2 * kPi * k / n)));
    ContactSet set;
    findContacts(e, s, kEdgeConeSlots, set);
    double least = 1.0;
    for (const std::size_t slot : {10u, 11u}) {
      if (!(set.valid >> slot & 1u)) continue;
      const ContactPoint& c = set.slots[slot];
      EXPECT_LT((c.p - edge(e, c.t)).norm(), 1e-14);
      EXPECT_NEAR(over(c.rim), 0.0, 1e-14);
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-14);
      EXPECT_NEAR(c.normal.dot(c.dp), 0.0, 1e-12);
      // the cone's line through the place lies in it
      const Vector2d radial = (c.rim.tail<2>() - c.rim(0) * s.bore_lean).normalized();
      const Vector2d slope = s.bore_lean + s.chamfer.sine / s.chamfer.cosine * radial;
      EXPECT_NEAR(c.normal.dot(Vector3d(1.0, slope(0), slope(1))), 0.0, 1e-13);
      // the gap's gradient is the normal times a length
      const double length =
          std::hypot(s.chamfer.cosine, s.chamfer.sine + s.chamfer.cosine * s.bore_lean.dot(radial));
      least = std::min(least, c.gap * length);
    }
    if (least == 1.0) continue;  // its foot is beyond the cone
    EXPECT_NEAR(least, lowest, 4e-10);
    ++compared;
  }
  EXPECT_GT(compared, 200);
}

// A peg along the bore touches nothing as long as it is thinner, and is met by the wall all round
// at the same distance.
TEST_F(LeaningBore, PegAlongTheBoreIsFree) {
  for (int i = 0; i < 50; ++i) {
    const ContactShapes s = shapes(1e-3);
    const double lean = s.bore_lean.norm(), tilt = std::atan(lean);
    const double up = std::atan2(s.bore_lean(1), s.bore_lean(0));
    const double depth = uniform(0.005, 0.03);
    // the lowest point of an edge that tilts towards the bore's lean lies on that side
    const EdgeCircle e = edgeAt({-depth, -depth * s.bore_lean(0), -depth * s.bore_lean(1)}, tilt,
                                up, uniform(-kPi, kPi), kRadius);
    ASSERT_NEAR(e.axis0.cross(e.axis1).tail<2>().dot(s.bore_lean) / lean / std::sin(tilt), 1.0,
                1e-9);
    ContactSet set;
    findContacts(e, s, kAllContactSlots, set);
    for (std::size_t slot = 0; slot < set.slots.size(); ++slot) {
      if (!(set.valid >> slot & 1u)) continue;
      // 25 mm times the square of the lean: the circle seen along the bore is an ellipse
      EXPECT_NEAR(set.slots[slot].gap, s.hole_radius - kRadius, kRadius * lean * lean)
          << toString(set.slots[slot].feature);
    }
    EXPECT_LE(contactClearance(e, s), s.hole_radius - kRadius);
  }
}

// A peg that touches the wall and is drawn out along the bore: the gap stays until the place comes
// to the rim, and goes over into that of edge_edge without a step.
TEST_F(LeaningBore, RimHandsOverToTheWall) {
  int handed = 0;
  for (int i = 0; i < 100; ++i) {
    const ContactShapes s = shapes(1e-4);
    EdgeCircle e = inside(s);
    // moves it to the wall
    double farthest = 0.0, where = 0.0;
    for (int k = 0; k < 40; ++k) {
      farthest = static_cast<double>(BodiesReference::largest(
          [&](Real t) { return Real(rho(s, edge(e, static_cast<double>(t)))); }));
      const Vector2d out = (e.center.tail<2>() - e.center(0) * s.bore_lean).normalized();
      where = std::atan2(out.y(), out.x());
      e.center.tail<2>() += (s.hole_radius - 1e-7 - farthest) * out;
    }
    ASSERT_NEAR(farthest, s.hole_radius - 1e-7, 1e-9) << where;
    ContactSet all;
    findContacts(e, s, kRimSideSlots, all);
    bool in_the_way = false;  // the peg's side
    for (const std::size_t slot : {5u, 6u}) {
      in_the_way = in_the_way || (all.valid >> slot & 1u && all.slots[slot].gap < 0.0);
    }
    if (in_the_way) continue;
    const Vector3d out(1.0, s.bore_lean(0), s.bore_lean(1));
    double before = 1.0;
    bool rim_before = false;
    constexpr double kStep = 5e-6;
    ContactSet set;
    for (double way = 0.0; way < 0.025; way += kStep) {
      EdgeCircle at = e;
      at.center += way * out;
      findContacts(at, s, kEdgeEdgeSlots | kEdgeWallSlots, set);
      double least = 1.0;
      bool rim = false;
      for (std::size_t slot = 0; slot < 5; ++slot) {
        if (!(set.valid >> slot & 1u) || set.slots[slot].gap > least) continue;
        least = set.slots[slot].gap;
        rim = slot < 2;
      }
      // nothing moves faster than the peg
      if (least < 1.0 && before < 1.0) {
        EXPECT_NEAR(least, before, 1.01 * kStep) << "way " << way;
        if (rim && !rim_before) ++handed;
        // along the wall nothing changes
        if (!rim) {
          EXPECT_NEAR(least, 1e-7, 2e-8) << "way " << way;
        }
      }
      before = least;
      rim_before = rim;
    }
  }
  EXPECT_GT(handed, 20);
}

}  // namespace
}  // namespace assembly_cell
