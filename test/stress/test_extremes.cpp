// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Parameters at their extremes: every run ends ok or with a named reason, finite, without energy
// from nowhere. ASSEMBLY_CELL_LONG_STRESS=1 makes the drift run 1e7 steps long (default 2e5).
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "random_scene.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// the run gets to its end, or stops before it with a reason; error control bounds its energy
void expectSane(const Scenario& s, double duration, const std::string& what) {
  const stress::Verdict v = stress::evaluate(s, duration);
  EXPECT_TRUE(v.finite) << what;
  EXPECT_FALSE(v.hung) << what;
  EXPECT_NE(v.reason, "unknown") << what;
  if (v.reason == "ok") {
    EXPECT_EQ(v.reached, duration) << what;
  } else {
    EXPECT_LT(v.reached, duration) << what << ": " << v.reason;
  }
  if (stress::controlsError(s)) {
    EXPECT_LT(v.gain, 1.0) << what << ": " << v.reason;
  }
}

TEST(Extremes, ContactStiffnessOverEightDecades) {
  for (double ratio = 1.0; ratio < 2e8; ratio *= 100.0) {
    Scenario s = load("chapter8_force_two_3N", {"contact.law=spring_dashpot"});
    s.contact.stiffness = 100.0 * ratio;  // over the coupling's 100 N/m along the axis
    s.contact.damping = 0.2 * std::sqrt(s.contact.stiffness * s.mechanism.peg.mass);
    s.solver.tolerance = 1e-9;
    expectSane(s, 0.004, "ratio " + std::to_string(ratio));
  }
}

TEST(Extremes, StepsOverFiveDecades) {
  for (const std::string integrator : {"rk4", "hamming"}) {
    for (const char* const law : {"spring_dashpot", "viscous", "rigid"}) {
      for (const double step : {1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
        Scenario s = load("chapter8_force_two_3N", {std::string("contact.law=") + law});
        s.solver.integrator = integrator;
        s.solver.step = step;
        expectSane(s, std::min(0.03, 3000 * step), integrator + " " + law + std::to_string(step));
      }
    }
  }
}

// Painlevé: a sliding point is inconsistent from mu = n.Wn / |t.Wn| on, W the mobility of the
// point. docs/theory/thesis.md: 1.53 to 1.68 for the listed geometries.
TEST(Extremes, FrictionUpToOneStaysBelowPainlevesBound) {
  double least = 1e9;
  for (const char* const name : {"sliding", "chapter8_force_one_10N", "chapter8_force_two_10N"}) {
    Simulation sim(load(name));
    const Scenario& s = sim.scenario();
    const Pose peg = sim.pegPose();
    const Vector3d a = peg.R.col(2), center = peg.p + s.mechanism.peg.half_height * a;
    const Matrix3d J =
        Matrix3d::Identity() / s.mechanism.peg.inertia_transverse +
        (1 / s.mechanism.peg.inertia_axial - 1 / s.mechanism.peg.inertia_transverse) * a *
            a.transpose();
    for (const ContactReport& c : sim.contacts()) {
      if (!c.valid || std::abs(c.gap) > 1e-8) continue;
      const Vector3d r = c.point - center;
      Matrix3d S;
      S << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
      const Vector3d Wn = (Matrix3d::Identity() / s.mechanism.peg.mass - S * J * S) * c.normal;
      const double normal = c.normal.dot(Wn);
      least = std::min(least, normal / (Wn - normal * c.normal).norm());
    }
  }
  std::printf("Painleve bound on friction: %.3f\n", least);
  EXPECT_GT(least, 1.5);
  EXPECT_LT(least, 1.7);
  for (const double mu : {0.0, 0.01, 0.1, 0.35, 0.6, 0.8, 1.0}) {
    Scenario s = load("chapter8_force_two_10N");
    s.mechanism.friction = {mu, mu};
    s.solver.tolerance = 1e-9;
    expectSane(s, 0.03, "mu " + std::to_string(mu));
  }
}

// units of mass and of length: the same motion, scaled
TEST(Extremes, MassAndLengthScale) {
  const auto run = [](double mass, double length) {
    Scenario s = load("chapter8_force_one_3N");
    const double L = length, M = mass;
    for (double* x :
         {&s.mechanism.peg.radius, &s.mechanism.peg.half_height, &s.mechanism.peg.coupling_height,
          &s.mechanism.peg.exciter_height, &s.mechanism.hole.radius, &s.rest.x, &s.rest.y,
          &s.rest.z, &s.initial.carrier_x, &s.initial.carrier_y, &s.mechanism.gravity,
          &s.solver.tolerance}) {
      *x *= L;
    }
    s.initial.position *= L;
    s.mechanism.peg.mass *= M;
    s.mechanism.carrier.mass *= M;
    s.mechanism.carrier.inertia *= M * L * L;
    s.mechanism.peg.inertia_transverse *= M * L * L;
    s.mechanism.peg.inertia_axial *= M * L * L;
    s.mechanism.exciter.amplitude *= M * L;
    for (CouplingMatrix* K : {&s.mechanism.coupling.stiffness, &s.mechanism.coupling.damping}) {
      K->diagonal.head<3>() *= M;
      K->diagonal.tail<3>() *= M * L * L;
      K->k26 *= M * L;
      K->k35 *= M * L;
    }
    Simulation sim(s);
    EXPECT_EQ(sim.advance(0.03), StopReason::kOk) << mass << " " << length;
    Vector9 q = sim.state().q;
    for (const int i : {0, 1, 2, 6, 7}) q(i) /= L;
    return q;
  };
  const Vector9 base = run(1, 1);
  for (const double mass : {1e-3, 1e3}) {
    // 1e-6 m: a run of 1e-11 m a step with stick and slip
    EXPECT_LT((run(mass, 1) - base).cwiseAbs().maxCoeff(), 1e-6) << mass;
  }
  for (const double length : {0.1, 10.0}) {
    EXPECT_LT((run(1, length) - base).cwiseAbs().maxCoeff(), 1e-5) << length;
  }
}

TEST(Extremes, ZeroClearanceAndTransitions) {
  for (const double tilt : {0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1}) {
    for (const double offset : {0.0, 1e-12, 1e-6, 1e-3}) {
      for (const double clearance : {0.0, 1e-9, 1e-5}) {
        Scenario s = load("cell");
        s.contact.law = ContactLaw::kRigid;
        s.mechanism.hole.radius = s.mechanism.peg.radius + clearance;
        const Vector3d axis(std::sin(tilt), 0.0, std::cos(tilt));
        s.initial = InitialState{};
        s.initial.euler = {std::atan2(axis.x(), axis.z()), std::acos(axis.y()), 0.0};
        s.initial.position = Vector3d(offset, 0, s.mechanism.peg.radius * std::sin(tilt) + 1e-6) +
                             s.mechanism.peg.half_height * axis;
        const Vector3d coupling = s.initial.position + s.mechanism.peg.coupling_height * axis;
        s.initial.carrier_x = coupling.x();
        s.rest = {coupling.x(),       0.0, coupling.z() - 1e-4, 0.0, s.initial.euler.theta,
                  s.initial.euler.phi};
        s.initial.carrier_y = 0.0;
        s.solver.tolerance = 1e-9;
        expectSane(s, 0.005,
                   "tilt " + std::to_string(tilt) + " offset " + std::to_string(offset) +
                       " clearance " + std::to_string(clearance));
      }
    }
  }
}

TEST(Extremes, ZenoBehaviourAndResonance) {
  // slow drive through stick and slip
  Scenario chatter = load("chapter8_force_two_1N");
  chatter.mechanism.friction = {0.35, 0.05};
  chatter.mechanism.exciter.amplitude = 4.0;
  chatter.mechanism.exciter.frequency = 30.0;
  expectSane(chatter, 0.05, "chatter");
  // natural frequencies of the high stiffness, docs/theory/thesis.md
  for (const double w : {16.0, 229.0, 737.0, 969.0, 991.0}) {
    Scenario s = load("chapter8_damping_two_none");
    s.mechanism.exciter.frequency = w;
    s.solver.tolerance = 1e-9;
    expectSane(s, 0.05, "resonance " + std::to_string(w));
  }
}

TEST(Extremes, MillionsOfStepsWithoutDrift) {
  const bool long_run = std::getenv("ASSEMBLY_CELL_LONG_STRESS") != nullptr;
  Scenario s = load("cell", {"contact={law: none}"});
  s.mechanism.coupling.damping = CouplingMatrix{};
  s.mechanism.carrier.damping.setZero();
  s.solver.integrator = "rk4";
  s.solver.step = 2e-5;
  s.initial.velocity = Vector3d(0.01, -0.02, 0.015);
  Simulation sim(s);
  const double before = sim.energy(),
               scale = before - s.mechanism.peg.mass * s.mechanism.gravity * sim.state().q(0);
  const double steps = long_run ? 1e7 : 2e5;
  ASSERT_EQ(sim.advance(steps * s.solver.step), StopReason::kOk);
  const double drift = std::abs(sim.energy() - before) / scale;
  std::printf("energy drift over %.0e steps: %.1e\n", steps, drift);
  // rk4 damps a mode of w by (w h)^6/72 a step: at most 1e-11 for the carrier's 1030 rad/s
  EXPECT_LT(drift, 2e-12 * steps + 1e-9);
}

}  // namespace
}  // namespace assembly_cell
