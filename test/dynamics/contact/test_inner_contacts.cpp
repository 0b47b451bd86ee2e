// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contacts other than edge on edge, and restitution, against the independent simulation in extended
// precision of benchmark/support/reference_mechanism.h: impact, slip, stick and parting on the
// plane, the wall of the hole and the peg's side.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "../../../benchmark/support/reference_mechanism.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;
using reference::Meeting;

// Chapter 8's mechanism at medium damping with a hole that leaves 0.5 mm round the peg
Scenario mechanism(const std::vector<std::string>& overrides) {
  std::vector<std::string> all = {"hole.radius=0.0255",
                                  "contact.law=rigid",
                                  "contact.features=[edge_edge, edge_plane, edge_wall, rim_side]",
                                  "gravity=9.8",
                                  "solver.tolerance=1e-13",
                                  "solver.max_step=1e-3",
                                  "coupling.stiffness.diagonal=[2000, 5.0e4, 5.0e4, 50, 50, 50]"};
  all.insert(all.end(), overrides.begin(), overrides.end());
  return loadScenario(
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/chapter8_force_one_3N.yaml", all);
}

// bottom centre, tilt towards x; the rest pose pulls by `pull` (x, y, z)
void place(Scenario& s, const Vector3d& bottom, double tilt, const Vector3d& pull) {
  const Vector3d axis(std::sin(tilt), 0.0, std::cos(tilt));
  s.initial = InitialState{};
  s.initial.euler = {tilt, std::acos(0.0), 0.0};
  s.initial.position = bottom + s.mechanism.peg.half_height * axis;
  const Vector3d coupling = s.initial.position + s.mechanism.peg.coupling_height * axis;
  s.initial.carrier_x = coupling.x();
  s.initial.carrier_y = coupling.y();
  s.rest = {coupling.x() + pull.x(), coupling.y() + pull.y(),
            coupling.z() + pull.z(), 0.0,
            std::acos(0.0),          tilt};
  s.mechanism.carrier.stiffness = Vector3d(5e4, 5e4, 50);
  s.mechanism.carrier.damping = Vector3d(50, 50, 0.01);
}

// Largest difference of the peg's position at ten times against `bound`; the slots that must have
// carried; events of the package and the reference may differ by those that open a slot idly.
void compare(const std::string& what, const Scenario& s, const std::array<Meeting, 2>& places,
             double duration, std::vector<std::size_t> slots, double bound) {
  Simulation sim(s);
  reference::Mechanism<long double> truth(s, 1e-16L, places);
  double error = 0.0;
  for (int i = 1; i <= 10; ++i) {
    const double t = duration * i / 10;
    EXPECT_EQ(sim.advance(t), StopReason::kOk) << what << ": " << toString(sim.stopReason());
    EXPECT_TRUE(truth.advance(t)) << what;
    for (int j = 0; j < 3; ++j) {
      const double x = static_cast<double>(truth.state()[static_cast<std::size_t>(j)]);
      error = std::max(error, std::abs(sim.state().q(j) - x));
    }
    const auto contacts = sim.contacts();
    for (std::size_t k = 0; k < slots.size();) {
      if (contacts[slots[k]].state != ContactReport::kOpen) {
        slots.erase(slots.begin() + static_cast<std::ptrdiff_t>(k));
      } else {
        ++k;
      }
    }
  }
  EXPECT_TRUE(slots.empty()) << what << ": slot " << (slots.empty() ? 0 : slots[0])
                             << " never carried";
  EXPECT_LT(error, bound) << what;
  EXPECT_EQ(sim.counts().impacts, truth.impacts()) << what;
  std::printf("%-36s %3ld events, %2ld impacts (package: %lld, %lld), error %.1e m\n", what.c_str(),
              truth.events(), truth.impacts(), static_cast<long long>(sim.counts().events),
              static_cast<long long>(sim.counts().impacts), error);
}

Scenario onThePlane(const std::vector<std::string>& overrides = {}) {
  Scenario s = mechanism(overrides);
  place(s, {0.08, 0.01, 0.0055}, 0.2, {1e-3, 0, -2e-3});
  s.initial.velocity = Vector3d(0.05, 0.02, -0.1);
  return s;
}
// leaning outwards, the bottom edge meets the wall; leaning inwards, the rim meets the side
Scenario onTheWall(const std::vector<std::string>& overrides = {}) {
  Scenario s = mechanism(overrides);
  place(s, {4e-4, 0, -0.01}, -0.02, {1e-3, 5e-5, -2e-3});
  s.initial.velocity = Vector3d(0.05, 0.01, -0.02);
  return s;
}
Scenario onTheSide(const std::vector<std::string>& overrides = {}) {
  Scenario s = mechanism(overrides);
  place(s, {0, 0, -0.01}, 0.02, {1e-3, 5e-5, -2e-3});
  s.initial.velocity = Vector3d(0.05, 0.01, -0.02);
  return s;
}
// tilted by the coupling until the bottom is at one wall and the rim at the other side
Scenario jammed(const std::vector<std::string>& overrides = {}) {
  Scenario s = mechanism(overrides);
  place(s, {-2.5e-4, 0, -0.015}, 0.02, {1e-3, 5e-5, -5e-3});
  s.rest.phi += 0.1;
  return s;
}
const std::array<Meeting, 2> kPlane = {Meeting::kEdgePlane, Meeting::kEdgeWall};
const std::array<Meeting, 2> kInside = {Meeting::kEdgeWall, Meeting::kRimSide};

// a hundred steps of 1e-13 m each, and what an impact makes of it
constexpr double kSteps = 1e-11;

TEST(InnerContacts, Rigid) {
  compare("plane", onThePlane(), kPlane, 0.02, {2}, kSteps);
  compare("wall", onTheWall(), kInside, 0.02, {3}, kSteps);
  compare("side", onTheSide(), kInside, 0.02, {5}, kSteps);
  const std::vector<std::string> hard = {"exciter.amplitude=10"};
  compare("plane, 10 N", onThePlane(hard), kPlane, 0.02, {2}, kSteps);
  compare("wall, 10 N", onTheWall(hard), kInside, 0.02, {3}, kSteps);
  compare("side, 10 N", onTheSide(hard), kInside, 0.02, {5}, kSteps);
}

TEST(InnerContacts, RigidJammed) {
  compare("wall and side", jammed(), kInside, 0.02, {3, 5}, 1e-10);
  compare("wall and side, 10 N", jammed({"exciter.amplitude=10"}), kInside, 0.02, {3, 5}, 1e-10);
}

TEST(InnerContacts, CompliantLaws) {
  for (const std::string name : {"spring_dashpot", "viscous"}) {
    const std::string law =
        "contact={law: " + name +
        (name == "viscous" ? ", rate: 700}" : ", stiffness: 1e5, damping: 200}");
    compare("plane, " + name, onThePlane({law}), kPlane, 0.01, {2}, kSteps);
    compare("wall, " + name, onTheWall({law}), kInside, 0.01, {3}, kSteps);
    compare("side, " + name, onTheSide({law}), kInside, 0.01, {5}, kSteps);
    // the viscous contact yields: the side is not reached
    const std::vector<std::size_t> carry = {3, name == "viscous" ? 3u : 5u};
    compare("wall and side, " + name, jammed({law}), kInside, 0.02, carry, 1e-10);
  }
}

TEST(InnerContacts, WithRestitution) {
  for (const std::string e : {"0.5", "1"}) {
    const std::vector<std::string> bouncing = {"contact.restitution=" + e};
    compare("plane, e = " + e, onThePlane(bouncing), kPlane, 0.02, {}, kSteps);
    compare("wall, e = " + e, onTheWall(bouncing), kInside, 0.02, {}, kSteps);
    compare("side, e = " + e, onTheSide(bouncing), kInside, 0.02, {}, kSteps);
    compare("wall and side, e = " + e, jammed(bouncing), kInside, 0.02, {}, 1e-10);
  }
}

// The 13th impact of the edges comes in slowly and slips: to stop its slip would take a pull.
TEST(EdgeContacts, WithRestitution) {
  const Scenario s = loadScenario(
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/chapter8_force_one_10N.yaml",
      {"contact.restitution=0.5", "solver.tolerance=1e-13"});
  Simulation sim(s);
  reference::Mechanism<long double> truth(s, 1e-13L);
  ASSERT_EQ(sim.advance(0.016), StopReason::kOk);
  ASSERT_TRUE(truth.advance(0.016));
  EXPECT_EQ(sim.counts().impacts, 13);
  EXPECT_EQ(truth.impacts(), 13);
  for (int j = 0; j < 3; ++j) {
    // measured 1e-14; 2e-7 with an impact without friction
    EXPECT_NEAR(sim.state().q(j), static_cast<double>(truth.state()[static_cast<std::size_t>(j)]),
                kSteps);
  }
}

}  // namespace
}  // namespace assembly_cell
