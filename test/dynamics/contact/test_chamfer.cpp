// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A peg that slides down the chamfer of the hole, or down its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// falls on its own from over the cone, `off` from the axis, free to turn
Scenario dropped(double off, double height, const std::vector<std::string>& more = {}) {
  std::vector<std::string> all = {"contact={law: rigid}", "solver.tolerance=1e-12",
                                  "hole.chamfer={width: 1.0e-3, angle: 0.6}",
                                  "friction={static: 0, sliding: 0}"};
  all.insert(all.end(), more.begin(), more.end());
  Scenario s = load("cell", all);
  s.mechanism.coupling = CouplingParameters{};
  s.mechanism.carrier.stiffness.setZero();
  s.initial = InitialState{};
  s.initial.euler = {0.002, 1.5707963267948966 + 0.001, 0.3};
  s.initial.position = Vector3d(off, 0.0, s.mechanism.peg.half_height + height);
  return s;
}

// Without friction it slides over the cone, a contact of this feature, and off it without losing
// energy.
void expectSlideWithoutLoss(Scenario s, ContactFeature cone) {
  s.initial.close = true;
  Simulation simulation(s);
  const double before = simulation.energy();
  int on_cone = 0;
  double lost = 0.0;
  const auto start = simulation.pegPose().p;
  while (simulation.time() < 0.02 && simulation.counts().impacts == 0) {
    ASSERT_EQ(simulation.advance(simulation.time() + 2e-4), StopReason::kOk);
    if (simulation.counts().impacts > 0) break;
    for (const ContactReport& c : simulation.contacts()) {
      on_cone += c.state != ContactReport::kOpen && c.feature == cone;
    }
    lost = std::max(lost, std::abs(simulation.energy() - before));
  }
  EXPECT_GT(on_cone, 10);
  EXPECT_LT((simulation.pegPose().p - start).z(), -2e-4);
  EXPECT_LT(lost, 1e-11 * before);
}

TEST(Chamfer, SlidesDownWithoutLoss) {
  expectSlideWithoutLoss(dropped(4e-4, 0.0), ContactFeature::kEdgeCone);
}

// Bounces that give back all they take: off the cone, off its edges, off the wall.
TEST(Chamfer, BouncesKeepTheEnergy) {
  for (const double off : {3e-4, 7e-4, 1.05e-3}) {
    Scenario s = dropped(off, 2e-3, {"contact={law: rigid, restitution: 1.0}"});
    Simulation simulation(s);
    const double before = simulation.energy();
    ASSERT_EQ(simulation.advance(0.08), StopReason::kOk) << off;
    EXPECT_GE(simulation.counts().impacts, 2) << off;
    EXPECT_NEAR(simulation.energy(), before, 1e-6 * before) << off;
  }
}

// What contact.features leaves out ends a run by its name.
TEST(Chamfer, ExcludedConeEndsTheRunByName) {
  Simulation simulation(
      dropped(7e-4, 1e-3,
              {"contact={law: rigid, features: [edge_edge, edge_plane, edge_wall, rim_side]}"}));
  EXPECT_EQ(simulation.advance(0.1), StopReason::kEdgeCone);
  EXPECT_STREQ(toString(simulation.stopReason()), "edge_cone");
}

// The same on its own chamfer, over a sharp rim.
TEST(Chamfer, OfThePegSlidesDownWithoutLoss) {
  expectSlideWithoutLoss(
      dropped(4e-4, 0.0, {"hole.chamfer={width: 0}", "peg.chamfer={width: 1.0e-3, angle: 0.6}"}),
      ContactFeature::kRimCone);
}

TEST(Chamfer, OfThePegBouncesKeepTheEnergy) {
  for (const char* hole : {"hole.chamfer={width: 0}", "hole.chamfer={width: 1.0e-3, angle: 0.6}"}) {
    for (const double off : {3e-4, 7e-4, 1.05e-3}) {
      const Scenario s = dropped(off, 2e-3,
                                 {"contact={law: rigid, restitution: 1.0}", hole,
                                  "peg.chamfer={width: 1.0e-3, angle: 0.6}"});
      Simulation simulation(s);
      const double before = simulation.energy();
      ASSERT_EQ(simulation.advance(0.08), StopReason::kOk) << hole << off;
      EXPECT_GE(simulation.counts().impacts, 2) << hole << off;
      EXPECT_NEAR(simulation.energy(), before, 1e-6 * before) << hole << off;
    }
  }
}

TEST(Chamfer, OfThePegThatIsExcludedEndsTheRunByName) {
  Simulation simulation(dropped(
      7e-4, 1e-3,
      {"hole.chamfer={width: 0}", "peg.chamfer={width: 1.0e-3, angle: 0.6}",
       "contact={law: rigid, features: [edge_edge, edge_plane, edge_wall, rim_side, edge_cone]}"}));
  EXPECT_EQ(simulation.advance(0.1), StopReason::kRimCone);
  EXPECT_STREQ(toString(simulation.stopReason()), "rim_cone");
}

// The other laws: pressed on the cone with friction enough to hold, all stand still at about the
// same place.
TEST(Chamfer, AllLawsHoldThePegOnTheCone) {
  for (const char* law : {"contact={law: rigid}",
                          "contact={law: viscous, rate: 1000, "
                          "stationary_rows: true}"}) {
    Scenario s = load("cell", {law, "hole.chamfer={width: 1.0e-3, angle: 1.2}",
                               "friction={static: 0.8, sliding: 0.8}"});
    place(s, {6e-4, 0.0, 0.01}, 0.003, 1.0);
    s.initial.close = true;
    const Simulation closed(s);
    s.initial.close = false;
    s.initial.position.z() = closed.state().q(0);
    s.rest.z = closed.state().q(0) + s.mechanism.peg.coupling_height - 1e-4;
    Simulation simulation(s);
    ASSERT_EQ(simulation.advance(0.3), StopReason::kOk) << law;
    const Vector3d at = simulation.pegPose().p;
    ASSERT_EQ(simulation.advance(0.5), StopReason::kOk) << law;
    EXPECT_LT((simulation.pegPose().p - at).norm(), 1e-7) << law;
    const auto contacts = simulation.contacts();
    EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [](const ContactReport& c) {
      return c.feature == ContactFeature::kEdgeCone && c.state == ContactReport::kStick &&
             c.force.norm() > 1.0;
    })) << law;
  }
}

}  // namespace
}  // namespace assembly_cell
