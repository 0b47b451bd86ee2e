// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A peg wedged between the wall and the rim of the hole: slip that creeps, and the budget of steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "../dynamics/scenes.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// A start of an alignment 0.09 mm off the hole's axis: the tilted edge has fallen 3 mm into the
// hole; both places of contact slip by micrometres a second or rest.
State wedged(double tilting) {
  State s;
  s.q << 0.025809938108257786, 0.0011900950217406891, 0.00057055388898329313, 0.043606194823247055,
      1.5499209890940326, -0.00098445057928140409, 0.0033812584426979688, 0.001620235723965479,
      -0.00098703031366158202;
  s.v << 0, 0, 0, 1.2e-4 * tilting, -2.5e-4 * tilting, 0, 0, 0, 0;
  return s;
}
RestPose rest() {
  RestPose pose;
  pose.x = 0.0033840052644493143;
  pose.y = 0.0016216042736201261;
  pose.z = 0.075802576947591876;
  pose.yaw = -0.00098729147810047192;
  pose.theta = 1.5500891230091156;
  pose.phi = 0.043281774290911595;
  return pose;
}

TEST(Wedge, InconsistentSlipEnds) {
  for (const double tilting : {-1.0, 0.0, 1.0}) {
    Scenario scene = startedFrom(cell(), wedged(tilting));
    scene.rest = rest();
    Simulation sim(scene);
    const Pose start = sim.pegPose();
    double largest = 0.0;
    for (int i = 1; i <= 10; ++i) {
      ASSERT_EQ(sim.advance(2e-3 * i, 100000), StopReason::kOk);
      ASSERT_EQ(sim.time(), 2e-3 * i) << "too many steps";
      // the forces, each within its cone, make the motion: Newton's law of the peg
      Vector3d force(0, 0, -scene.mechanism.peg.mass * scene.mechanism.gravity);
      for (const ContactReport& c : sim.contacts()) {
        if (!c.valid) continue;
        force += c.force;
        const double N = c.normal.dot(c.force);
        largest = std::max(largest, N);
        const double friction = (c.force - N * c.normal).norm();
        EXPECT_LE(friction, scene.mechanism.friction.static_coefficient * N * (1 + 1e-6) + 1e-6);
      }
      const Vector6 w = sim.couplingWrench();
      force += -sim.carrierPose().R * Vector3d(w.head<3>());
      const Vector9& a = sim.acceleration();
      const Vector3d momentum = scene.mechanism.peg.mass * Vector3d(a(1), a(2), a(0));
      EXPECT_LT((force - momentum).norm(), 1e-9 * std::max(1.0, largest)) << sim.time();
    }
    EXPECT_LT((sim.pegPose().p - start.p).norm(), 1e-4);
    // creeping at the threshold of rest takes steps of 2e-8 s: a million
    EXPECT_LT(sim.counts().steps, 50000);
  }
}

TEST(Wedge, TooManyStepsEndTheRunWithAReason) {
  CellParameters parameters;
  parameters.block_size = 47;
  SimulatedPlant plant(cell({"solver.integrator=rk4", "solver.step=3e-9"}),
                       cell({"solver.integrator=rk4", "solver.step=3e-9"}).mechanism, parameters);
  std::string reason;
  try {
    plant.next({});
  } catch (const PlantError& error) {
    reason = error.what();
  }
  EXPECT_EQ(reason, "simulation stopped: too_many_steps");
}

}  // namespace
}  // namespace assembly_cell
