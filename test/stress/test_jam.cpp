// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Slipping points that friction wedges (Painlevé's paradox) while a vibrating peg is lowered into
// the hole: force grows without bound within finite time, or no force agrees with the slip.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "assembly_cell/cell/start.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Lowered open-loop by 10 mm, as config/studies/optimum.yaml does: stiffness is a factor, damping
// keeps its ratio to critical.
struct Lowering {
  Vector2d start;  // bottom centre [m]
  double frequency, stiffness;
};

Scenario lowering(const Lowering& run) {
  Scenario s =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/lowering.yaml", {});
  s.mechanism.exciter.frequency = run.frequency;
  s.mechanism.coupling.stiffness.diagonal.tail<5>() *= run.stiffness;
  s.mechanism.coupling.damping.diagonal.tail<5>() *= std::sqrt(run.stiffness);
  s.mechanism.coupling.stiffness.k26 *= run.stiffness;
  s.mechanism.coupling.stiffness.k35 *= run.stiffness;
  return startAt(s, run.start, Vector2d(0.1, 0.0), 5e-4);
}

double exciterSpeed(const Simulation& sim) {
  const Kinematics k = kinematics(sim.state());
  return k.v.norm() + sim.scenario().mechanism.peg.exciter_height * k.omega.norm();
}

// Checks energy, cones and Newton's law all the way; `lost` is the most energy that a jam took,
// `faster` how much faster the exciter may be within a step than at its ends.
void lower(const Lowering& run, double faster, double& lost) {
  const Scenario scene = lowering(run);
  const double mu = scene.mechanism.friction.static_coefficient;
  Simulation sim(scene);
  ASSERT_EQ(sim.advance(0.0), StopReason::kOk);
  RestPose rest = sim.rest();
  rest.z -= 0.010;
  sim.setRestTarget(rest);

  double largest = 0.0;
  // as the studies do, a wedge of more than 300 N at a look ends it
  for (int look = 1; look <= 250 && largest < 300.0; ++look) {
    const double until = 0.002 * look;
    while (sim.time() < until) {
      const double time = sim.time(), energy = sim.energy(), before = exciterSpeed(sim);
      const auto jams = sim.counts().painleve_impacts;
      ASSERT_EQ(sim.advance(until, 1), StopReason::kOk) << sim.time();
      ASSERT_LT(sim.counts().evaluations, 200000) << "creeps at " << sim.time();
      if (sim.counts().painleve_impacts == jams) continue;
      // the exciter's work in the step that ends with the jam
      const double work = faster * scene.mechanism.exciter.amplitude *
                          std::max(before, exciterSpeed(sim)) * (sim.time() - time);
      EXPECT_LE(sim.energy() - energy, work + 1e-12) << sim.time();
      lost = std::max(lost, energy - sim.energy());
    }
    // the forces, each within its cone, make the motion: Newton's law of the peg
    const Kinematics k = kinematics(sim.state());
    const Vector2d drive = exciterForce({scene.mechanism.exciter, 0.0}, sim.time());
    Vector3d force = fromThesisAxes(drive(0) * k.R0 + drive(1) * k.R1);
    force.z() -= scene.mechanism.peg.mass * scene.mechanism.gravity;
    largest = 0.0;
    for (const ContactReport& c : sim.contacts()) {
      if (c.state == ContactReport::kOpen) continue;
      force += c.force;
      const double N = c.normal.dot(c.force);
      largest = std::max(largest, N);
      EXPECT_GE(N, 0.0);
      const double friction = (c.force - N * c.normal).norm();
      // slip that begins keeps the direction of its friction while the contact plane turns
      EXPECT_LE(friction, mu * N * (1 + 5e-3) + 1e-6) << sim.time();
    }
    force += -sim.carrierPose().R * Vector3d(sim.couplingWrench().head<3>());
    const Vector9& a = sim.acceleration();
    const Vector3d momentum = scene.mechanism.peg.mass * Vector3d(a(1), a(2), a(0));
    EXPECT_LT((force - momentum).norm(), 1e-9 * std::max(1.0, largest)) << sim.time();
  }
}

class Jam : public testing::TestWithParam<Lowering> {};

TEST_P(Jam, SlipWedgedByFrictionComesToRest) {
  double lost = 0.0;
  lower(GetParam(), 1.0, lost);
  // what a slip of a tenth of a metre per second had
  EXPECT_GT(lost, 1e-4);
}

// Where two points rest and no slip agrees with its friction, the peg holds itself: no creep, and
// no force outside of its cone. Of 400 such starts one fails; 24 did while rest was refused.
TEST(Wedged, PegHoldsItself) {
  std::mt19937 random(4);
  const auto within = [&](double middle, double half) {
    return middle + half * (static_cast<double>(random()) / 2147483648.0 - 1.0);
  };
  for (int i = 0; i < 60; ++i) {
    const double x = within(4.6e-4, 2e-5), y = within(3.05e-3, 1e-4);
    SCOPED_TRACE(testing::Message() << "start " << x << ", " << y);
    double lost = 0.0;
    lower({{x, y}, 800.0, 1.0}, 2.0, lost);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Lowered, Jam,
    testing::Values(
        Lowering{{-0.0014364872993179077, 0.00414737406297957}, 547.7225575051662, 1.0},
        Lowering{
            {-0.002641640507518914, 0.002966136334547277}, 566.4259823661758, 0.7680237888595673},
        Lowering{
            {0.0014259458320735512, 0.002992375106956805}, 493.606416048748, 0.726687313297122},
        Lowering{{0.0020140046368131402, 0.0034254144965307058}, 690.4704046729464, 1.0},
        Lowering{
            {0.0007091924864798785, 0.003213123519695364}, 568.2236977852881, 0.9608728872146457},
        Lowering{
            {-0.001249551937915385, 0.003673065689811483}, 639.4861811771989, 0.9050026087323204}));

}  // namespace
}  // namespace assembly_cell
