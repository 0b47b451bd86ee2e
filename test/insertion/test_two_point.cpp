// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Two-point contact against the simulator's contact search and against lines and angles written out
// in extended precision.
#include "assembly_cell/insertion/two_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/geometry/contact_geometry.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// a tilted peg in the hole, its base centre at (x, 0, z): the nearest gaps of wall and mouth
struct Gaps {
  double wall = 0.0, mouth = 0.0;
};
Gaps gapsAt(const PegInHole& fit, double tilt, double x, double z) {
  const Vector3d side(std::sin(tilt), 0.0, std::cos(tilt)),
      base(std::cos(tilt), 0.0, -std::sin(tilt));
  // thesis axes: axis0 x axis1 is the peg's axis
  const EdgeCircle edge{toThesisAxes({x, 0.0, z}), toThesisAxes(base),
                        toThesisAxes(Vector3d::UnitY()), fit.peg_radius};
  EXPECT_LT((edge.axis0.cross(edge.axis1) - toThesisAxes(side)).norm(), 1e-15);
  ContactShapes shapes;
  shapes.hole_radius = fit.hole_radius;
  shapes.reach = 1.0;
  ContactSet set;
  findContacts(edge, shapes, kEdgeWallSlots | kRimSideSlots, set);
  Gaps gaps{HUGE_VAL, HUGE_VAL};
  for (int slot = 3; slot < 7; ++slot) {
    if (!(set.valid & 1u << slot)) continue;
    double& gap = slot < 5 ? gaps.wall : gaps.mouth;
    gap = std::min(gap, set.slots[static_cast<std::size_t>(slot)].gap);
  }
  return gaps;
}

// depth of the lowest point, within a tenth of `about`, at which the search finds the mouth
// touched, the wall being touched
double depthBySearch(const PegInHole& fit, double tilt, double about) {
  const double x = fit.peg_radius * std::cos(tilt) - fit.hole_radius;  // base edge on the left wall
  const auto mouth = [&](double lowest) {
    return gapsAt(fit, tilt, x, fit.peg_radius * std::sin(tilt) - lowest).mouth;
  };
  double free = 0.9 * about, met = 1.1 * about;
  EXPECT_GT(mouth(free), 0.0);
  EXPECT_LT(mouth(met), 0.0);
  for (int i = 0; i < 200 && met - free > 1e-16; ++i) {
    const double lowest = 0.5 * (free + met);
    (mouth(lowest) > 0.0 ? free : met) = lowest;
  }
  EXPECT_NEAR(gapsAt(fit, tilt, x, fit.peg_radius * std::sin(tilt) - free).wall, 0.0, 1e-15);
  return free;
}

TEST(TwoPoint, TheSimulatorsGeometryTouchesThere) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit;
  double worst = 0.0;
  for (int i = 0; i < 300; ++i) {
    const double r = 0.003 * std::pow(50.0 / 3.0, unit(random));
    const PegInHole fit{r, r * (1.0 + std::pow(10.0, -3.0 + 2.0 * unit(random)))};
    const double limit = std::acos(fit.peg_radius / fit.hole_radius);
    const double tilt = limit * (0.02 + 0.96 * unit(random));
    const double lowest = twoPointContact(fit, tilt).lowest;
    worst = std::max(worst, std::abs(lowest - depthBySearch(fit, tilt, lowest)));
  }
  // asked for: 1 nm; found: rounding of the search, whose gap changes by the tilt for each metre
  EXPECT_LT(worst, 1e-12);
}

TEST(TwoPoint, DepthAndTiltAreInverse) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit;
  for (int i = 0; i < 20000; ++i) {
    const double r = std::pow(10.0, -4.0 + 4.0 * unit(random));
    const PegInHole fit{r, r * (1.0 + std::pow(10.0, -6.0 + 5.0 * unit(random)))};
    const double tilt =
        std::acos(fit.peg_radius / fit.hole_radius) * std::pow(10.0, -6.0 * unit(random)) * 0.9999;
    const TwoPointContact contact = twoPointContact(fit, tilt);
    const long double D = 2.0L * fit.hole_radius, d = 2.0L * fit.peg_radius, t = tilt;
    EXPECT_NEAR(contact.depth, static_cast<double>((D - d * std::cos(t)) / std::sin(t)),
                4e-15 * contact.depth + 1e-18 * r / tilt);
    EXPECT_GE(contact.wall_contact, 0.0);
    const auto back = twoPointTilt(fit, contact.depth);
    ASSERT_TRUE(back);
    // the slope grows without bound where the base is about to leave the hole
    const double steep = std::abs(static_cast<double>(D * std::cos(t) - d)) / fit.peg_radius;
    EXPECT_NEAR(*back, tilt, 1e-14 * tilt / steep);
  }
  EXPECT_FALSE(twoPointTilt({0.025, 0.0251}, 1e-3));
}

// Whitney's small tilt: tilt = c D / l
TEST(TwoPoint, SmallTiltIsWhitneys) {
  const PegInHole fit{0.025, 0.02501};
  const double c = (fit.hole_radius - fit.peg_radius) / fit.hole_radius;
  const double tilt = 1e-4, depth = twoPointContact(fit, tilt).depth;
  // what is left out: d tilt / 2 of l, here 1.3e-5 of it
  EXPECT_NEAR(depth, c * 2 * fit.hole_radius / tilt, 1e-4 * depth);
}

// two contact forces oppose each other where the line between the contacts lies in both cones
TEST(Wedging, TheLineBetweenTheContactsInBothCones) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit;
  int wedged = 0;
  for (int i = 0; i < 20000; ++i) {
    const PegInHole fit{0.01, 0.01 * (1.0 + std::pow(10.0, -3.0 + 2.0 * unit(random)))};
    const double tilt = std::acos(fit.peg_radius / fit.hole_radius) * (0.01 + 0.98 * unit(random));
    const double friction = 0.02 + 1.5 * unit(random);
    const TwoPointContact contact = twoPointContact(fit, tilt);
    const long double t = tilt, line = std::atan2(static_cast<long double>(contact.wall_contact),
                                                  2.0L * fit.hole_radius);
    const long double at_wall = line, at_mouth = line + t,
                      cone = std::atan(static_cast<long double>(friction));
    if (std::abs(at_mouth - cone) < 1e-14L) continue;
    const bool both = at_wall <= cone && at_mouth <= cone;
    EXPECT_EQ(contact.depth <= wedgingDepth(fit, friction), both) << tilt << " " << friction;
    wedged += both;
  }
  EXPECT_GT(wedged, 2000);
  EXPECT_LT(wedged, 18000);
}

TEST(Wedging, FromThisTiltOn) {
  const PegInHole fit{0.025, 0.0251};
  const double friction = 0.3, tilt = wedgingTilt(fit, friction).value();
  EXPECT_NEAR(twoPointContact(fit, tilt).depth, wedgingDepth(fit, friction), 1e-15);
  // Whitney: c / friction
  EXPECT_NEAR(tilt, 1e-4 / 0.0251 / friction, 0.03 * tilt);
  EXPECT_FALSE(wedgingTilt(fit, 0.05));  // the base isn't in the hole yet
}

TEST(TwoPoint, RefusesByName) {
  EXPECT_THROW(twoPointContact({0.025, 0.025}, 0.01), InputError);
  EXPECT_THROW(twoPointContact({-0.025, 0.0251}, 0.01), InputError);
  EXPECT_THROW(twoPointContact({0.025, std::nan("")}, 0.01), InputError);
  EXPECT_THROW(twoPointContact({0.025, 0.0251}, 0.0), InputError);
  EXPECT_THROW(twoPointContact({0.025, 0.0251}, 0.2), InputError);
  EXPECT_THROW(twoPointTilt({0.025, 0.0251}, -1.0), InputError);
  EXPECT_THROW(wedgingDepth({0.025, 0.0251}, 0.0), InputError);
}

}  // namespace
}  // namespace assembly_cell
