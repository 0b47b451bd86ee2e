// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Vectors in thesis axes (1, 2, 3) = (z, x, y) of frame `hole`, as in the header under test.
#include "assembly_cell/geometry/contact_geometry.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "contact_reference.h"
#include "single_slot.h"

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kHoleRadius = 0.0251;

// Edge whose lowest point lies in the direction of `lean` (angle from axis 2), tilted by `tilt`.
Vector3d pointOf(const EdgeCircle& e, double t) {
  return e.center + e.radius * (std::cos(t) * e.axis0 + std::sin(t) * e.axis1);
}

Vector3d rimPoint(double s, double r_h = kHoleRadius) {
  return {0.0, r_h * std::cos(s), r_h * std::sin(s)};
}

// Minimum of a unimodal function by golden section, argument to about 1e-8 of the interval.
double golden(const std::function<double(double)>& f, double low, double high) {
  const double g = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = high - g * (high - low), b = low + g * (high - low);
  double fa = f(a), fb = f(b);
  for (int i = 0; i < 55; ++i) {
    if (fa < fb) {
      high = b, b = a, fb = fa;
      fa = f(a = high - g * (high - low));
    } else {
      low = a, a = b, fa = fb;
      fb = f(b = low + g * (high - low));
    }
  }
  return 0.5 * (low + high);
}

// Squared distance of an edge point from the rim: dense samples of the rim, then refinement.
double squaredToRim(const Vector3d& p, double r_h) {
  constexpr int n = 48;
  const auto f = [&](double s) { return (p - rimPoint(s, r_h)).squaredNorm(); };
  int best = 0;
  for (int i = 1; i < n; ++i) {
    if (f(2 * kPi * i / n) < f(2 * kPi * best / n)) best = i;
  }
  return f(golden(f, 2 * kPi * (best - 1) / n, 2 * kPi * (best + 1) / n));
}

struct Nearest {
  double t, distance;
};

// All local minima of the distance of the two circles by brute force.
std::vector<Nearest> localMinima(const EdgeCircle& e, double r_h) {
  constexpr int n = 240;
  const auto f = [&](double t) { return squaredToRim(pointOf(e, t), r_h); };
  std::vector<double> samples(n);
  for (int i = 0; i < n; ++i) samples[static_cast<std::size_t>(i)] = f(2 * kPi * i / n);
  std::vector<Nearest> minima;
  for (int i = 0; i < n; ++i) {
    const double here = samples[static_cast<std::size_t>(i)];
    if (here > samples[static_cast<std::size_t>((i + 1) % n)]) continue;
    if (here >= samples[static_cast<std::size_t>((i + n - 1) % n)]) continue;
    const double t = golden(f, 2 * kPi * (i - 1) / n, 2 * kPi * (i + 1) / n);
    minima.push_back({t, std::sqrt(f(t))});
  }
  return minima;
}

double angleBetween(double a, double b) { return std::abs(std::remainder(a - b, 2 * kPi)); }

bool allFinite(const ContactPoint& c) {
  return !c.valid || (std::isfinite(c.t) && std::isfinite(c.gap) && std::isfinite(c.cross_norm) &&
                      c.p.allFinite() && c.dp.allFinite() && c.rim.allFinite() &&
                      c.tangent.allFinite() && c.normal.allFinite());
}

class ContactGeometry : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }

  // An edge beside the hole that leans over it, lowered until the given slot's gap is zero.
  EdgeCircle touching(int slot) {
    for (;;) {
      const double offset = uniform(1e-3, 10e-3), where = uniform(-kPi, kPi);
      const double lean = where + kPi + uniform(-0.5, 0.5);
      EdgeCircle e = edgeAt({0, offset * std::cos(where), offset * std::sin(where)},
                            uniform(0.01, 0.25), lean, uniform(-kPi, kPi));
      // the gap falls with the height: go down to a candidate, then bisect
      const double amplitude = edgeHeight(e).amplitude;
      const auto gap = [&](double height) {
        e.center(0) = height;
        const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
        return c.valid ? c.gap : 1.0;
      };
      double high = amplitude, low = high;
      while (low > -amplitude && gap(low) > 0.0) low -= amplitude / 50;
      if (gap(low) > 0.0) continue;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (gap(middle) > 0.0 ? high : low) = middle;
      }
      e.center(0) = high;
      const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
      if (c.valid && std::abs(c.gap) < 1e-12) return e;
    }
  }

 private:
  std::mt19937_64 engine_{5};
};

TEST_F(ContactGeometry, GapIsTheDistanceOfTheCircles) {
  for (int i = 0; i < 150; ++i) {
    const int slot = i % 2;
    EdgeCircle e = touching(slot);
    const ContactPoint touch = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
    // penetrating, or apart
    e.center += Vector3d(uniform(-3e-4, 3e-4), uniform(-1e-4, 1e-4), uniform(-1e-4, 1e-4));
    const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, true, touch.t);
    if (!c.valid) continue;
    const std::vector<Nearest> minima = localMinima(e, kHoleRadius);
    double best = 1.0, distance = 0.0;
    for (const Nearest& m : minima) {
      if (angleBetween(m.t, c.t) < best) best = angleBetween(m.t, c.t), distance = m.distance;
    }
    // golden section finds the argument to the square root of the rounding of squares: 1e-8 times
    // the radius, amplified by nearly parallel tangents; the distance itself is of second order
    EXPECT_LT(best, 1e-5);
    EXPECT_NEAR(std::abs(c.gap), distance, 1e-10);
    // the frame of the contact is as promised: unit normal across both tangents, up and inwards
    EXPECT_LT((c.p - pointOf(e, c.t)).norm(), 1e-15);
    EXPECT_NEAR(c.normal.norm(), 1.0, 1e-14);
    EXPECT_NEAR(c.normal.dot(c.dp), 0.0, 1e-15);
    EXPECT_NEAR(c.normal.dot(c.tangent), 0.0, 1e-15);
    EXPECT_LT((c.normal * c.gap - (c.p - c.rim)).norm(), 1e-14);
    EXPECT_GE(c.normal(0), 0.0);
    EXPECT_LE(c.normal.dot(c.p), c.normal(0) * c.p(0) + 1e-15);
  }
}

// Whatever the start, a found candidate is the same one: warm, cold, and the other slot's side.
TEST_F(ContactGeometry, WarmAndColdStartsAgree) {
  for (int i = 0; i < 2000; ++i) {
    const int slot = i % 2;
    EdgeCircle e = touching(slot);
    e.center(0) -= uniform(0, 1e-4);
    const ContactPoint cold = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
    const ContactPoint warm = findEdgeEdge(e, kHoleRadius, slot, true, cold.t + 0.01);
    ASSERT_TRUE(cold.valid && warm.valid);
    EXPECT_LT(angleBetween(cold.t, warm.t), 1e-12);
    EXPECT_NEAR(cold.gap, warm.gap, 1e-16);
  }
}

// Starts of the thesis's figures 7.7 and 8.1.
EdgeCircle thesisEdge(double height, double x2, double phi) {
  const Matrix3d R = (AngleAxisd(phi, Vector3d::UnitZ()) * AngleAxisd(1.771, Vector3d::UnitY()))
                         .toRotationMatrix();  // thesis axes; psi = 0
  return {Vector3d(height, x2, 0.040) - 0.030 * R.col(2), R.col(0), R.col(1), 0.025};
}
ContactPoint thesisContact(double height, double x2, double phi, int slot) {
  // first a start for the search, which does not look for contacts that are high up
  const EdgeCircle e = thesisEdge(height, x2, phi);
  ContactPoint c;
  for (int k = 0; k < 32 && !c.valid; ++k) c = findEdgeEdge(e, 0.025, slot, true, kPi * k / 16);
  return c;
}

TEST_F(ContactGeometry, ThesisStartsWithTwoContacts) {
  for (int slot = 0; slot < 2; ++slot) {
    const ContactPoint c = thesisContact(0.03402, 0, 0, slot);
    ASSERT_TRUE(c.valid);
    EXPECT_NEAR(c.gap, 2.5e-6, 0.05e-6);  // listed 0.0025 mm
    // listed (±9.25, 23.20) mm, in figures read to 0.05 mm
    EXPECT_NEAR(c.p(1), slot == 0 ? 9.25e-3 : -9.25e-3, 0.05e-3);
    EXPECT_NEAR(c.p(2), 23.20e-3, 0.05e-3);
    // listed height of exact contact, 34.01750 mm
    EXPECT_NEAR(thesisContact(0.0340175, 0, 0, slot).gap, 0.0, 5e-9);
  }
}

TEST_F(ContactGeometry, ThesisStartsWithOneContact) {
  const ContactPoint c = thesisContact(0.03485, -2.25e-3, 0.1, 0);
  ASSERT_TRUE(c.valid);
  EXPECT_NEAR(c.gap, 0.056e-3, 0.0005e-3);
  EXPECT_NEAR(c.p(1), 5.95e-3, 0.005e-3);
  EXPECT_NEAR(c.p(2), 24.28e-3, 0.005e-3);
  // listed height of exact contact 34.7942 mm; the edges meet 0.25 um below
  EXPECT_NEAR(thesisContact(0.0347942, -2.25e-3, 0.1, 0).gap, 0.0, 0.3e-6);
  // the other side is more than a millimetre apart, at the distance brute force finds
  const ContactPoint other = thesisContact(0.03485, -2.25e-3, 0.1, 1);
  ASSERT_TRUE(other.valid);
  EXPECT_GT(other.gap, 1.1e-3);
  double nearest = 1.0;
  for (const Nearest& m : localMinima(thesisEdge(0.03485, -2.25e-3, 0.1), 0.025)) {
    if (angleBetween(m.t, other.t) < 1e-4) nearest = m.distance;
  }
  EXPECT_NEAR(other.gap, nearest, 1e-10);
}

// Moving the lowest point across the rim hands over from edge–plane to edge–edge and back: one of
// them at every place, the gap without a step.
TEST_F(ContactGeometry, HandOverAtTheRimIsContinuous) {
  for (int i = 0; i < 200; ++i) {
    const double tilt = uniform(0.02, 0.3), depth = uniform(-5e-6, 5e-6);
    EdgeCircle e = edgeAt(Vector3d::Zero(), tilt, 0.0, uniform(-kPi, kPi));
    e.center(0) = edgeHeight(e).amplitude - depth;
    // the centre moves across the lean: the lowest point is on the rim here
    const double across =
        std::sqrt(kHoleRadius * kHoleRadius - std::pow(kRadius * std::cos(tilt), 2));
    const double side = i % 2 ? 1.0 : -1.0;
    for (const double beyond : {1e-9, 1e-7, 1e-5}) {
      e.center(2) = side * (across + beyond);
      const ContactPoint plane = findEdgePlane(e, kHoleRadius);
      ASSERT_TRUE(plane.valid);
      for (int slot = 0; slot < 2; ++slot) {
        const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
        // none, or another crossing far away
        EXPECT_TRUE(!c.valid || angleBetween(c.t, plane.t) > 0.1);
      }

      e.center(2) = side * (across - beyond);
      EXPECT_FALSE(findEdgePlane(e, kHoleRadius).valid);
      int found = 0;
      for (int slot = 0; slot < 2; ++slot) {
        const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
        if (!c.valid || angleBetween(c.t, plane.t) > 0.1) continue;
        ++found;
        // the contact point runs back along the edge by `beyond`: the edge has risen by half the
        // square over the radius times the tilt, and leans; twice that
        const double lean = 2 * tilt * beyond / across;
        EXPECT_NEAR(c.gap, plane.gap,
                    tilt * beyond * beyond / kRadius + std::abs(depth) * lean * lean + 1e-16);
        EXPECT_LT((c.normal - plane.normal).norm(), lean + 1e-12);
      }
      EXPECT_EQ(found, 1);
    }
  }
}

TEST_F(ContactGeometry, MirroredPegsMirrorTheirContacts) {
  for (int i = 0; i < 500; ++i) {
    const int slot = i % 2;
    EdgeCircle e = touching(slot);
    e.center(0) -= uniform(0, 1e-4);
    const ContactPoint c = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
    ASSERT_TRUE(c.valid);
    const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
    // the mirror image with its second axis turned round is right-handed again: t runs backwards
    // and the slots change places
    const EdgeCircle image{mirror * e.center, mirror * e.axis0, mirror * -e.axis1, e.radius};
    const ContactPoint m = findEdgeEdge(image, kHoleRadius, 1 - slot, false, 0.0);
    ASSERT_TRUE(m.valid);
    // rounding of lengths below 0.03, amplified by nearly parallel tangents
    EXPECT_NEAR(m.gap, c.gap, 1e-16);
    EXPECT_LT((m.p - mirror * c.p).norm(), 1e-15);
    EXPECT_LT((m.normal - mirror * c.normal).norm(), 1e-12);
  }
}

TEST_F(ContactGeometry, WhollyInsideOrOutsideIsNoContact) {
  for (const double tilt : {0.0, 1e-6, 0.1}) {
    for (int slot = 0; slot < 2; ++slot) {
      // inside the bore with clearance all round; beside the block
      EXPECT_FALSE(
          findEdgeEdge(edgeAt({-0.01, 2e-5, 0}, tilt, 1.0), kHoleRadius, slot, false, 0).valid);
      EXPECT_FALSE(
          findEdgeEdge(edgeAt({0, 0.06, 0.01}, tilt, 1.0), kHoleRadius, slot, false, 0).valid);
      EXPECT_FALSE(findEdgeEdge(edgeAt({0, 0, 0}, tilt, 1.0), kHoleRadius, slot, false, 0).valid);
    }
    EXPECT_FALSE(findEdgePlane(edgeAt({-0.01, 2e-5, 0}, tilt, 1.0), kHoleRadius).valid);
    EXPECT_TRUE(findEdgePlane(edgeAt({0, 0.06, 0.01}, tilt, 1.0), kHoleRadius).valid);
  }
}

// Parallel circles: the contacts are their crossings, all normals upright.
TEST_F(ContactGeometry, UprightPegTouchesWhereTheCirclesCross) {
  const double offset = 0.004, height = -1e-6;
  for (const double tilt : {0.0, 1e-6}) {
    const EdgeCircle e = edgeAt({height, offset, 0}, tilt, kPi, 0.7);
    // law of cosines, the crossing's angle about the hole's axis
    const double c = (kHoleRadius * kHoleRadius + offset * offset - kRadius * kRadius) /
                     (2 * kHoleRadius * offset);
    int found = 0;
    for (int slot = 0; slot < 2; ++slot) {
      const ContactPoint p = findEdgeEdge(e, kHoleRadius, slot, false, 0.0);
      ASSERT_TRUE(allFinite(p));
      // a tilt of 1e-6 lifts the edge by up to 25 nm, and turns normals by tilt over the angle of
      // the crossing (0.16); with tilt 0 the sign of the climb is only rounding
      if (!p.valid) continue;
      ++found;
      EXPECT_NEAR(std::cos(std::atan2(p.p(2), p.p(1))), c, 10 * tilt + 1e-12);
      EXPECT_NEAR(p.gap, height, kRadius * tilt + 1e-15);
      EXPECT_LT((p.normal - Vector3d::UnitX()).norm(), 20 * tilt + 1e-12);
    }
    EXPECT_EQ(found, 2) << tilt;
    // parallel to the plane: the farthest point stands for the face
    const ContactPoint plane = findEdgePlane(edgeAt({height, offset, 0}, 0, 0), kHoleRadius);
    ASSERT_TRUE(plane.valid);
    EXPECT_NEAR(plane.p(1), offset + kRadius, 1e-15);
    EXPECT_EQ(plane.gap, height);
  }
}

// Any pose, any start: finite or invalid.
TEST_F(ContactGeometry, NeverNaN) {
  int valid = 0;
  const double tiny[] = {0.0, 1e-300, 1e-18, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3};
  for (int i = 0; i < 100000; ++i) {
    const double scale = tiny[static_cast<std::size_t>(i % 8)];
    const double tilt = i % 3 == 0 ? tiny[static_cast<std::size_t>(i / 8 % 8)] : uniform(0, 1.5);
    const double r_h = i % 5 == 0 ? kRadius : kHoleRadius;
    const EdgeCircle e = edgeAt(scale * 10 * vector(), tilt, uniform(-kPi, kPi), uniform(-4, 4));
    const double warm = uniform(-10, 10);
    for (int slot = 0; slot < 3; ++slot) {
      const ContactPoint c =
          slot == 2 ? findEdgePlane(e, r_h) : findEdgeEdge(e, r_h, slot, i % 2 == 0, warm);
      ASSERT_TRUE(allFinite(c)) << i << " " << slot;
      if (!c.valid) continue;
      ++valid;
      const ContactRates rates = contactRates(e, c, vector(), vector());
      ASSERT_TRUE(std::isfinite(rates.gap_bias) && rates.rolling.allFinite()) << i << " " << slot;
    }
  }
  EXPECT_GT(valid, 10000);
}

}  // namespace
}  // namespace assembly_cell
