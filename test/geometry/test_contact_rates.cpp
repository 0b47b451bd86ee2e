// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Gap rate, gap acceleration and rolling of every feature against differences. Thesis axes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

#include "contact_reference.h"

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// A peg in accelerated motion: a polynomial path, two rotations about fixed axes.
struct RateMotion {
  EdgeCircle start;
  Vector3d body;  // any point of the peg, at the start
  Vector3d velocity, acceleration, axis1, axis2;
  double rate1, rate2, angular_acceleration;

  Vector3d place(double t) const { return body + velocity * t + 0.5 * acceleration * t * t; }
  EdgeCircle at(double t) const {
    const Matrix3d R = (AngleAxisd(rate2 * t, axis2) *
                        AngleAxisd(rate1 * t + 0.5 * angular_acceleration * t * t, axis1))
                           .toRotationMatrix();
    return {place(t) + R * (start.center - body), R * start.axis0, R * start.axis1, start.radius};
  }
  Vector3d omega(double t) const {
    const Matrix3d second = AngleAxisd(rate2 * t, axis2).toRotationMatrix();
    return rate2 * axis2 + (rate1 + angular_acceleration * t) * (second * axis1);
  }
  Vector3d pointVelocity(double t, const Vector3d& p) const {
    return velocity + acceleration * t + omega(t).cross(p - place(t));
  }
  Vector3d pointAcceleration(const Vector3d& p) const {  // at t = 0
    const Vector3d alpha = angular_acceleration * axis1 + (rate2 * axis2).cross(rate1 * axis1);
    const Vector3d w = omega(0), r = p - body;
    return acceleration + alpha.cross(r) + w.cross(w.cross(r));
  }
};

class ContactRatesTest : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }

  RateMotion motionOf(const EdgeCircle& start) {
    RateMotion m;
    m.start = start;
    m.body = start.center + 0.03 * start.axis0.cross(start.axis1) + 0.01 * vector();
    m.velocity = 0.03 * vector();
    m.acceleration = vector();
    m.axis1 = vector().normalized();
    m.axis2 = vector().normalized();
    m.rate1 = uniform(-1, 1);
    m.rate2 = uniform(-1, 1);
    m.angular_acceleration = uniform(-10, 10);
    return m;
  }

  // derivatives of a slot's gap and of the peg's velocity at its point: stencils of fourth order
  struct Differences {
    double rate, acceleration;
    Vector3d velocity_rate;
    bool valid = true;
  };
  static Differences differentiate(const RateMotion& m, const ContactShapes& shapes,
                                   const ContactSet& start, std::size_t slot, double h) {
    std::array<double, 5> g{};
    std::array<Vector3d, 5> v;
    Differences d{};
    for (std::size_t i = 0; i < 5 && d.valid; ++i) {
      const double t = h * (static_cast<double>(i) - 2.0);
      ContactSet set = start;
      d.valid = findContacts(m.at(t), shapes, start.valid, set) >> slot & 1u;
      g[i] = set.slots[slot].gap;
      v[i] = m.pointVelocity(t, set.slots[slot].p);
    }
    d.rate = (g[0] - 8 * g[1] + 8 * g[3] - g[4]) / (12 * h);
    d.acceleration = (-g[0] + 16 * g[1] - 30 * g[2] + 16 * g[3] - g[4]) / (12 * h * h);
    d.velocity_rate = (v[0] - 8 * v[1] + 8 * v[3] - v[4]) / (12 * h);
    return d;
  }

  // compares every slot of `slots` that is valid at the start and through the stencil
  static int compare(const RateMotion& m, const ContactShapes& shapes, ContactSlotMask slots) {
    ContactSet start;
    const ContactSlotMask valid = findContacts(m.start, shapes, slots, start);
    int compared = 0;
    for (std::size_t slot = 0; slot < start.slots.size(); ++slot) {
      if (!(valid >> slot & 1u)) continue;
      const Differences coarse = differentiate(m, shapes, start, slot, 2e-4);
      const Differences fine = differentiate(m, shapes, start, slot, 1e-4);
      if (!coarse.valid || !fine.valid) continue;
      // halving the step takes away 15/16 of a stencil's error; what is left must be less than a
      // fifth of that, beyond rounding of gaps of 1e-17 m over h and h² and of velocities over h
      const double rate_error = std::abs(coarse.rate - fine.rate) / 5 + 1e-10;
      const double error = std::abs(coarse.acceleration - fine.acceleration) / 5 + 1e-7;
      const double roll_error = (coarse.velocity_rate - fine.velocity_rate).norm() / 5 + 1e-7;
      // points that run away near the common axis: differences tell nothing
      if (error > 1e-3 || roll_error > 1e-3) continue;
      const ContactPoint& c = start.slots[slot];
      const Vector3d v_m = m.pointVelocity(0, c.p), a_m = m.pointAcceleration(c.p);
      const EdgeCircle circle =
          kShoulderSlots >> slot & 1u ? shoulderOf(m.start, shapes.peg_chamfer) : m.start;
      const ContactRates rates = contactRates(circle, c, v_m, m.omega(0));
      EXPECT_NEAR(fine.rate, c.normal.dot(v_m), rate_error);
      EXPECT_NEAR(fine.acceleration, c.normal.dot(a_m) + rates.gap_bias, error)
          << toString(c.feature) << " gap " << c.gap;
      EXPECT_LT((fine.velocity_rate - a_m - rates.rolling).norm(), roll_error)
          << toString(c.feature);
      ++compared;
    }
    return compared;
  }

  std::mt19937_64 engine_{11};
};

ContactShapes reachingShapes(double clearance, double reach) {
  ContactShapes s;
  s.hole_radius = kRadius + clearance;
  s.peg_length = 0.06;
  s.reach = reach;
  return s;
}

// Tangents of two edges nearer to parallel let the point run at speeds that differences can't
// follow.
bool nearlyParallel(const ContactSet& set, const EdgeCircle& e, const ContactShapes& shapes) {
  return std::any_of(set.slots.begin(), set.slots.end(), [&](const ContactPoint& c) {
    return c.valid && c.feature == ContactFeature::kEdgeEdge &&
           std::abs(c.cross_norm) < 0.15 * e.radius * shapes.hole_radius;
  });
}

// Deep in the hole: edge on the wall, rim on the side, apart and penetrating. Gaps up to 0.2 mm, so
// that what vanishes with the gap is seen too.
TEST_F(ContactRatesTest, OfWallAndSide) {
  int compared[2] = {0, 0};
  for (int i = 0; i < 400; ++i) {
    const double where = uniform(-kPi, kPi), offset = uniform(1e-4, 5e-4);
    const EdgeCircle e =
        edgeAt({uniform(-0.02, -0.005), offset * std::cos(where), offset * std::sin(where)},
               uniform(0.002, 0.06), uniform(-kPi, kPi), uniform(-kPi, kPi), kRadius);
    const RateMotion m = motionOf(e);
    const ContactShapes shapes = reachingShapes(uniform(1e-5, 6e-4), 4e-4);
    compared[0] += compare(m, shapes, kEdgeWallSlots);
    compared[1] += compare(m, shapes, kRimSideSlots);
  }
  EXPECT_GT(compared[0], 100);
  EXPECT_GT(compared[1], 100);
}

// The face tilted over the rim, the peg far off the axis.
TEST_F(ContactRatesTest, OfTheFace) {
  int compared = 0;
  for (int i = 0; i < 200; ++i) {
    const double lean = uniform(-kPi, kPi), tilt = uniform(0.05, 0.3);
    const double offset = uniform(5e-3, 0.02), where = lean + uniform(-0.3, 0.3);
    EdgeCircle e = edgeAt({0, offset * std::cos(where), offset * std::sin(where)}, tilt, lean,
                          uniform(-kPi, kPi), kRadius);
    const ContactShapes shapes = reachingShapes(1e-4, 4e-4);
    // rim's point in the direction of the lean, r_h − offset from the peg's axis
    e.center(0) = std::tan(tilt) * (shapes.hole_radius - offset * std::cos(where - lean)) +
                  uniform(-1e-4, 1e-4);
    compared += compare(motionOf(e), shapes, kRimFaceSlots);
  }
  EXPECT_GT(compared, 100);
}

TEST_F(ContactRatesTest, OfEdgesOnPlaneFloorAndRim) {
  int compared[2] = {0, 0};
  for (int i = 0; i < 400; ++i) {
    const double where = uniform(-kPi, kPi), offset = uniform(1e-3, 10e-3);
    const bool floor = i % 4 == 0;
    EdgeCircle e =
        edgeAt({0, offset * std::cos(where), offset * std::sin(where)}, uniform(0.03, 0.3),
               where + kPi + uniform(-0.5, 0.5), uniform(-kPi, kPi), kRadius);
    ContactShapes shapes = reachingShapes(1e-4, 4e-4);
    const double amplitude = edgeHeight(e).amplitude;
    if (floor) {
      shapes.hole_depth = 0.01;
      e.center(0) = amplitude - 0.01 + uniform(-1e-4, 1e-4);
      compared[1] += compare(motionOf(e), shapes, kEdgePlaneSlots);
      continue;
    }
    // down to where a gap falls below the reach
    ContactSet set;
    e.center(0) = amplitude;
    while (!findContacts(e, shapes, kEdgeEdgeSlots, set) && e.center(0) > -amplitude) {
      e.center(0) -= 1e-4;
    }
    if (!nearlyParallel(set, e, shapes))
      compared[0] += compare(motionOf(e), shapes, kEdgeEdgeSlots);
  }
  EXPECT_GT(compared[0], 100);
  EXPECT_GT(compared[1], 50);
}

// The edge on the chamfer and on both of its edges, the side on both.
TEST_F(ContactRatesTest, OfAChamfer) {
  std::map<ContactSlotMask, int> compared;
  for (int i = 0; i < 1500; ++i) {
    ContactShapes shapes = reachingShapes(uniform(1e-4, 1e-3), 2e-4);
    shapes.chamfer = chamferOf(uniform(1e-3, 4e-3), uniform(0.2, 1.2));
    const double where = uniform(-kPi, kPi), height = shapes.chamfer.height;
    // over the cone, leaning on the mouth, with a steep side of the edge at the lower edge
    const int kind = i % 3;
    const double r = kind == 0 && i % 2 ? kRadius : 0.018;
    const double tilt = kind == 0 ? uniform(0.02, 0.6) : uniform(0.1, 0.45);
    const double at = kind == 0   ? r * std::sin(tilt) - height * uniform(-0.3, 1.2)
                      : kind == 1 ? uniform(-0.006, 0.0)
                                  : -height + 1e-3 * uniform(-1, 1);
    const double lean = where + kPi * (kind == 0 ? 1.0 : kind == 1 ? 0.0 : 0.5);
    EdgeCircle e = edgeAt({at, 0, 0}, tilt, lean + uniform(-0.5, 0.5), uniform(-kPi, kPi), r);
    ContactSet set;
    for (double x = -0.003; x < 0.02 && !set.valid; x += 1e-4) {
      e.center(1) = x * std::cos(where);
      e.center(2) = x * std::sin(where);
      findContacts(e, shapes, kAllContactSlots & ~kSharpRimSlots, set);
    }
    const RateMotion m = motionOf(e);
    if (nearlyParallel(set, e, shapes)) continue;
    for (const ContactSlotMask slots : {0x3u, 0x60u, 0x300u, 0xc00u, 0x3000u}) {
      compared[slots] += compare(m, shapes, slots);
    }
  }
  for (const auto& [slots, n] : compared) EXPECT_GT(n, 20) << std::hex << slots;
  EXPECT_EQ(compared.size(), 5u);
}

// The rim on the peg's chamfer, and the chamfer's upper edge on rim, wall and cone.
TEST_F(ContactRatesTest, OfAPegsChamfer) {
  std::map<ContactSlotMask, int> compared;
  for (int i = 0; i < 3000; ++i) {
    ContactShapes shapes = reachingShapes(uniform(1e-4, 1e-3), 2e-4);
    shapes.peg_chamfer = chamferOf(uniform(1e-3, 4e-3), uniform(0.2, 1.2));
    if (i % 2) shapes.chamfer = chamferOf(uniform(1e-3, 4e-3), uniform(0.2, 1.2));
    const double where = uniform(-kPi, kPi), deep = shapes.peg_chamfer.height;
    const double r = kRadius - shapes.peg_chamfer.width, tilt = uniform(0.02, 0.3);
    EdgeCircle e =
        edgeAt({r * std::sin(tilt) - uniform(0, 1.5) * (deep + shapes.chamfer.height), 0, 0}, tilt,
               where + kPi * (i % 3) / 2 + uniform(-0.5, 0.5), uniform(-kPi, kPi), r);
    ContactSet set;
    for (double x = -0.003; x < 0.02 && !set.valid; x += 1e-4) {
      e.center(1) = x * std::cos(where);
      e.center(2) = x * std::sin(where);
      findContacts(e, shapes, kShoulderSlots | kRimConeSlots, set);
    }
    const RateMotion m = motionOf(e);
    if (nearlyParallel(set, e, shapes)) continue;
    for (const ContactSlotMask slots :
         {3u << 14, 3u << 16, 3u << 19, 3u << 21, 3u << 23, 3u << 25}) {
      compared[slots] += compare(m, shapes, slots);
    }
  }
  for (const auto& [slots, n] : compared) EXPECT_GT(n, 20) << std::hex << slots;
  EXPECT_EQ(compared.size(), 6u);
}

// Whatever the pose and the motion: finite.
TEST_F(ContactRatesTest, AreFinite) {
  const double tiny[] = {0.0, 1e-300, 1e-18, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3};
  int seen[7] = {0, 0, 0, 0, 0, 0, 0};
  for (int i = 0; i < 40000; ++i) {
    const double scale = tiny[i % 8], tilt = i % 3 == 0 ? tiny[i / 8 % 8] : uniform(0, 0.3);
    Vector3d center = scale * 10 * vector();
    if (i % 2) center(0) -= 0.01;
    const EdgeCircle e = edgeAt(center, tilt, uniform(-kPi, kPi), uniform(-4, 4), kRadius);
    ContactShapes shapes = reachingShapes(tiny[i / 64 % 8], 1e-3);
    if (i % 5 == 0) shapes.chamfer = chamferOf(1e-3, 0.5);
    if (i % 7 < 2) shapes.peg_chamfer = chamferOf(1e-3, 0.5);
    ContactSet set;
    findContacts(e, shapes, kAllContactSlots, set);
    for (const ContactPoint& c : set.slots) {
      if (!c.valid) continue;
      ++seen[static_cast<int>(c.feature)];
      ASSERT_TRUE(std::isfinite(c.gap) && std::isfinite(c.t) && c.p.allFinite() &&
                  c.rim.allFinite());
      ASSERT_NEAR(c.normal.norm(), 1.0, 1e-12);
      const ContactRates rates = contactRates(e, c, vector(), vector());
      ASSERT_TRUE(std::isfinite(rates.gap_bias) && rates.rolling.allFinite());
    }
  }
  for (const int count : seen) EXPECT_GT(count, 100);
}

}  // namespace
}  // namespace assembly_cell
