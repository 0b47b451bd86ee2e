// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A peg that is pushed down onto the floor and against the wall: more contacts than it has
// freedoms, whose forces at rest are not determined. What Coulomb's law can hold rests.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "scenes.h"

namespace assembly_cell {
namespace {

constexpr double kSlip = 1e-5;  // slower is none at the default tolerance [m/s]

// number k of an even sequence between −1 and 1
double even(int k, double step) { return 2.0 * std::fmod(0.5 + step * k, 1.0) - 1.0; }

// Half a millimetre over the floor, with the carrier aside, lower and turned.
Scenario pushedDown(int k) {
  Scenario s = load("lowering", {"solver.tolerance=1e-9", "exciter.amplitude=0"});
  const double floor = -s.mechanism.hole.depth, radius = s.mechanism.peg.radius;
  place(s, {0.0, 0.0, floor + 5e-4}, 0.0, 0.0);
  s.initial.velocity = {0.0, 0.0, -0.01};
  const double play = s.mechanism.hole.radius - radius;
  s.rest.x = 4.0 * play * even(k, 0.819172513396164);
  s.rest.y = 4.0 * play * even(k, 0.671043606703789);
  s.rest.z += 1.5e-3 * (even(k, 0.549700477901970) - 1.0);
  s.rest.theta += 0.01 * even(k, 0.450305932530000);
  s.rest.phi += 0.01 * even(k, 0.368881000000000);
  return s;
}

// of the peg's edge, a bound [m/s]
double speedOf(const Simulation& sim) {
  const State& state = sim.state();
  return state.v.head<3>().norm() + 0.05 * state.v.segment<3>(3).norm();
}

void expectInsideCones(const Simulation& sim, int k) {
  const double mu = sim.scenario().mechanism.friction.static_coefficient;
  int carrying = 0;
  for (const ContactReport& c : sim.contacts()) {
    if (!c.valid || c.state == ContactReport::kOpen) continue;
    ++carrying;
    const double N = c.normal.dot(c.force);
    EXPECT_GE(N, -1e-6) << k;
    EXPECT_LE((c.force - N * c.normal).norm(), mu * N + 1e-6) << k;
  }
  EXPECT_GE(carrying, 4) << k;
}

TEST(Rest, IsWhereContactsCanHoldThePeg) {
  int wedged = 0;
  for (int k = 0; k < 30; ++k) {
    Simulation sim(pushedDown(k));
    ASSERT_EQ(sim.advance(0.4), StopReason::kOk) << k;
    if (closedContacts(sim) < 4) continue;
    ++wedged;
    // it rests, or slides as fast as slip is
    const double speed = speedOf(sim);
    EXPECT_TRUE(speed < 1e-8 || speed > kSlip) << k << ": " << speed;
    if (speed > kSlip) continue;
    expectInsideCones(sim, k);
    // within a step, too
    sim.sampleAt(0.4003, 0.402);
    expectInsideCones(sim, k);
  }
  EXPECT_GE(wedged, 10);
}

// The force that two resting points share is found at a step's end only: what they seem to carry
// on the way is no event to be looked for.
TEST(Rest, OfTwoEdgesTakesSixEvaluationsAStep) {
  for (const ContactLaw law : {ContactLaw::kViscous, ContactLaw::kRigid}) {
    Scenario s = onTwoEdges(0.05, 1e-4);
    s.contact.law = law;
    s.mechanism.exciter.amplitude = 0.1;
    Simulation sim(s);
    ASSERT_EQ(sim.advance(0.02), StopReason::kOk);
    ASSERT_EQ(closedContacts(sim), 2);
    const RunCounts before = sim.counts();
    for (int k = 1; k <= 100; ++k) ASSERT_EQ(sim.advance(0.02 + 2e-4 * k), StopReason::kOk);
    EXPECT_EQ(sim.counts().steps - before.steps, 100);
    EXPECT_EQ(sim.counts().evaluations - before.evaluations, 600);
  }
}

}  // namespace
}  // namespace assembly_cell
