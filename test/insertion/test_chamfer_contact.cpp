// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The chamfer's closed forms against the simulator's peg on the cone: a peg that can't turn (its
// inertia is a thousand tonnes) is a block on a slope.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/insertion/compliance.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// upright, its edge halfway along the cone; `angle`: of the cone to the hole's axis
Scenario onTheCone(double angle, double friction) {
  Scenario s = loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml",
                            {"contact={law: rigid}", "solver.tolerance=1e-12"});
  Mechanism& m = s.mechanism;
  m.hole.chamfer_width = 1e-3;
  m.hole.chamfer_angle = angle;
  m.friction = {friction, friction};
  m.peg.inertia_transverse = m.peg.inertia_axial = 1e6;
  m.coupling = CouplingParameters{};
  m.carrier.stiffness.setZero();
  const double x = m.hole.radius - m.peg.radius + 0.5e-3;
  s.initial = InitialState{};
  s.initial.euler = {0.0, M_PI / 2, 0.0};
  s.initial.position = Vector3d(x, 0.0, m.peg.half_height - 0.5e-3 / std::tan(angle));
  return s;
}

Vector2d acceleration(const Scenario& s, double time) {
  Simulation simulation(s);
  EXPECT_EQ(simulation.advance(time), StopReason::kOk);
  int on_cone = 0;
  for (const ContactReport& c : simulation.contacts()) {
    on_cone += c.state != ContactReport::kOpen && c.feature == ContactFeature::kEdgeCone;
  }
  EXPECT_EQ(on_cone, 1);
  return {simulation.acceleration()(1), simulation.acceleration()(0)};
}

// tan(slope) > friction slides, to a millionth
TEST(ChamferContact, SlidesWhereTheSlopeIsSteeperThanFriction) {
  for (const double angle : {0.3, M_PI / 4, 1.2}) {
    const double slope = M_PI / 2 - angle, limit = std::tan(slope);
    const Vector2d down(-std::sin(angle), -std::cos(angle));
    for (const double part : {0.0, 0.5, 1.0 - 1e-6, 1.0 + 1e-6, 1.5}) {
      const Scenario s = onTheCone(angle, part * limit);
      const double g = s.mechanism.gravity;
      const double slides = part < 1.0 ? g * (1.0 - part) * std::sin(slope) : 0.0;
      EXPECT_LT((acceleration(s, 1e-5) - slides * down).norm(), 1e-9 * g)
          << "angle " << angle << ", friction " << part << " of the limit";
      EXPECT_EQ(chamferForceRatio(slope, part * limit).has_value(), part < 1.0);
    }
  }
}

// Newtons into the hole for each of lateral resistance: with that load a peg that slides down goes
// on as it does, with more of it faster.
TEST(ChamferContact, ForceRatioKeepsItSliding) {
  for (const double angle : {0.3, M_PI / 4, 1.2}) {
    for (const double friction : {0.0, 0.1, 0.3}) {
      const auto ratio = chamferForceRatio(M_PI / 2 - angle, friction);
      ASSERT_TRUE(ratio.has_value());
      const Vector2d down(-std::sin(angle), -std::cos(angle));
      Scenario s = onTheCone(angle, friction);
      s.mechanism.gravity = 0.0;
      s.initial.velocity = 0.01 * Vector3d(down.x(), 0.0, down.y());
      for (const double more : {1.0, 1.1}) {
        // of 3 N to the side
        s.push = Vector3d(3.0, 0.0, -3.0 * more * *ratio);
        const double along = acceleration(s, 1e-3).dot(down);
        if (more == 1.0) {
          EXPECT_NEAR(along, 0.0, 1e-8) << angle << " " << friction;
        } else {
          EXPECT_GT(along, 0.1) << angle << " " << friction;
        }
      }
    }
  }
}

}  // namespace
}  // namespace assembly_cell
