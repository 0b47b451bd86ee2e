// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Each thesis switch on its own against the thesis's formula, written out here: what it adds to the
// forces of free motion, or to the acceleration of a contact.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/dynamics/simulation.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

State randomState(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  State s;
  for (int i = 0; i < 9; ++i) {
    const bool length = i < 3 || i == 6 || i == 7;
    s.q(i) = (length ? 0.05 : 0.5) * u(random);
    s.v(i) = (length ? 0.2 : 3.0) * u(random);
  }
  s.q(4) += M_PI_2;
  return s;
}

// generalised forces with the switch less those without
Vector9 extraForce(const Scenario& on, const State& state, double t) {
  Scenario off = on;
  off.thesis = ThesisSwitches{};
  const Eigen::Vector2d drive = exciterForce({on.mechanism.exciter, 0.0}, t);
  const RestMotion rest = restMotion(restProfile(on.rest), 0.0);
  const Kinematics k = kinematics(state);
  FreeMotion with, without;
  freeMotion(on, k, state, rest, drive, with);
  freeMotion(off, k, state, rest, drive, without);
  return with.force - without.force;
}

// moments (phi, theta, psi) of M in fixed axes by Re^-1 less by Re^T, written out: phi gets
// −cot(theta) (cph M1 + sph M2), psi all over sin(theta) instead of its projection
Vector3d momentError(const Vector9& q, const Vector3d& M) {
  const double along = std::cos(q(3)) * M(0) + std::sin(q(3)) * M(1);
  const double s = std::sin(q(4)), c = std::cos(q(4));
  return {-c / s * along, 0.0, along / s - (s * along + c * M(2))};
}

// 6.12, 6.16–6.18, the exciter: Mp = (−d1 Fp2, d1 Fp1, 0) in peg axes
TEST(ThesisMoments, OfTheExciter) {
  Scenario s = load("chapter8_force_one_10N", {"thesis_moments=true"});
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const State state = randomState(seed);
    const double t = 1e-4 * seed,
                 angle = s.mechanism.exciter.frequency * t + s.mechanism.exciter.phase;
    // in thesis peg axes 1, 2: x is axis 2, y is −(axis 1)
    const double Fp1 = -s.mechanism.exciter.amplitude * std::sin(angle);
    const double Fp2 = s.mechanism.exciter.amplitude * std::cos(angle);
    const double d1 = s.mechanism.peg.exciter_height;
    const Vector9& q = state.q;
    const double cph = std::cos(q(3)), sph = std::sin(q(3)), cth = std::cos(q(4)),
                 sth = std::sin(q(4)), cps = std::cos(q(5)), sps = std::sin(q(5));
    // to fixed axes by the rows of R
    const Vector3d R0(cph * cth * cps - sph * sps, sph * cth * cps + cph * sps, -sth * cps);
    const Vector3d R1(-cph * cth * sps - sph * cps, -sph * cth * sps + cph * cps, sth * sps);
    const Vector3d M = -d1 * Fp2 * R0 + d1 * Fp1 * R1;
    Vector9 expected = Vector9::Zero();
    expected.segment<3>(3) = momentError(q, M);
    // rounding of moments of 0.6 N m beside springs of 50 N m/rad
    EXPECT_LT((extraForce(s, state, t) - expected).norm(), 1e-12) << seed;
  }
}

// the listing's A(4..6, 7..12): moments of contact forces. One edge on the plane that presses with
// N = −K gap; lever and inverse mass matrix as in docs/theory/thesis.md.
TEST(ThesisMoments, OfAContact) {
  Scenario s = load("cell", {"contact={law: spring_dashpot, stiffness: 1e5, damping: 0}",
                             "friction={static: 0, sliding: 0}", "solver.tolerance=1e-14"});
  const double phi = 0.3, theta = 1.9, h = s.mechanism.peg.half_height, r = s.mechanism.peg.radius;
  const Vector3d a(std::cos(phi) * std::sin(theta), std::sin(phi) * std::sin(theta),
                   std::cos(theta));
  const double flat = std::sqrt(1 - a(0) * a(0)), N = 1.0;
  const Vector3d lever = -h * a - r / flat * (Vector3d::UnitX() - a(0) * a);
  s.initial = InitialState{};
  s.initial.euler = {phi, theta, 0.0};
  s.initial.position = Vector3d(0.08, 0.02, h * a(0) + r * flat - N / s.contact.stiffness);
  const double d2 = s.mechanism.peg.coupling_height;
  s.rest = {
      0.08 + d2 * a(1), 0.02 + d2 * a(2), s.initial.position.z() + d2 * a(0), 0.0, theta, phi};
  s.initial.carrier_x = s.rest.x;
  s.initial.carrier_y = s.rest.y;
  const auto velocity = [&](bool on, double t) {
    s.thesis.moments = on;
    Simulation sim(s);
    EXPECT_EQ(sim.advance(t), StopReason::kOk);
    return Vector9(sim.state().v);
  };
  const auto difference = [&](double t) {
    return Vector9((velocity(true, t) - velocity(false, t)) / t);
  };
  const Vector9 got = 2 * difference(1e-6) - difference(2e-6);
  const Vector3d Q = momentError((Vector9() << 0, 0, 0, phi, theta, 0, 0, 0, 0).finished(),
                                 lever.cross(N * Vector3d::UnitX()));
  const double I = s.mechanism.peg.inertia_transverse, I3 = s.mechanism.peg.inertia_axial,
               sn = std::sin(theta), c = std::cos(theta);
  const Vector3d expected((Q(0) - c * Q(2)) / (I * sn * sn), Q(1) / I,
                          -c * Q(0) / (I * sn * sn) + (1 / I3 + c * c / (I * sn * sn)) * Q(2));
  EXPECT_GT(expected.norm(), 1.0);
  // velocities of 1e-5 rad/s with rounding of 1e-16 over 1e-6 s, and the square of the step
  EXPECT_LT((got.segment<3>(3) - expected).norm(), 1e-6 * expected.norm());
  EXPECT_LT(got.head<3>().norm(), 1e-6 * expected.norm());
}

TEST(ThesisMoments, ErrorIsNoneUprightAndAFifthAtFig81) {
  Vector9 q = Vector9::Zero();
  q(4) = M_PI_2;
  EXPECT_LT(momentError(q, Vector3d(1, 2, 3)).norm(), 1e-15);
  q(4) = 1.771;  // what M1 puts into phi: docs/theory/thesis.md, 20 %
  EXPECT_NEAR(momentError(q, Vector3d(1, 0, 0))(0), 0.20, 5e-3);
}

// Listing, 6.14–6.16: FK2 and FK6 with K26 twice, FK3 and FK5 with K35 twice
TEST(ThesisCrossStiffness, CountsTwice) {
  const Scenario s = load("chapter8_force_one_10N", {"thesis_cross_stiffness=true"});
  const double k26 = s.mechanism.coupling.stiffness.k26, k35 = s.mechanism.coupling.stiffness.k35;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const State state = randomState(seed);
    const Vector9& q = state.q;
    const double d2 = s.mechanism.peg.coupling_height;
    const double cph = std::cos(q(3)), sph = std::sin(q(3)), cth = std::cos(q(4)),
                 sth = std::sin(q(4));
    const double x2 = q(1) + d2 * sph * sth - q(6), x3 = q(2) + d2 * cth - q(7);
    const double about2 = q(4) - s.rest.theta, about3 = q(3) - s.rest.phi;
    const double F2 = k26 * about3, F3 = k35 * about2;
    Vector9 expected;
    expected << 0, -F2, -F3, -d2 * cph * sth * F2 - k26 * x2,
        -d2 * (sph * cth * F2 - sth * F3) - k35 * x3, 0, F2, F3, 0;
    EXPECT_LT((extraForce(s, state, 0.0) - expected).norm(), 1e-12 * (1 + expected.norm())) << seed;
  }
  // with the text's 0.5 sqrt(Kii Kjj) the doubled block has no stiffness left in one direction
  const double k2 = s.mechanism.coupling.stiffness.diagonal(1),
               k6 = s.mechanism.coupling.stiffness.diagonal(5);
  EXPECT_NEAR(k2 * k6 - std::pow(2 * 0.5 * std::sqrt(k2 * k6), 2), 0.0, 1e-9 * k2 * k6);
}

// ---- in contact: one edge on the plane, moving in x, z; gap = z − h cos T − r sin T ----

struct PlaneScene {
  Scenario s;
  double h = 0.0, r = 0.0;
  double gap(const State& x) const { return x.q(0) - h * std::cos(x.q(3)) - r * std::sin(x.q(3)); }
  double gapRate(const State& x) const {
    return x.v(0) + (h * std::sin(x.q(3)) - r * std::cos(x.q(3))) * x.v(3);
  }
  // along the plane, of the point of the peg that touches
  double slip(const State& x) const {
    return x.v(1) + (-h * std::cos(x.q(3)) - r * std::sin(x.q(3))) * x.v(3);
  }
};

PlaneScene thesisPlane(const std::vector<std::string>& overrides, double tilt, double spin,
                       double lift) {
  PlaneScene p;
  p.s = load("cell", overrides);
  p.h = p.s.mechanism.peg.half_height;
  p.r = p.s.mechanism.peg.radius;
  InitialState& i = p.s.initial;
  i = InitialState{};
  i.euler = {tilt, M_PI_2, 0.0};
  i.position = Vector3d(0.08, 0.0, p.h * std::cos(tilt) + p.r * std::sin(tilt));
  i.euler_rates = Vector3d(spin, 0.0, 0.0);
  i.velocity.z() = -(p.h * std::sin(tilt) - p.r * std::cos(tilt)) * spin;  // gap rate zero
  const double d2 = p.s.mechanism.peg.coupling_height;
  i.carrier_x = i.position.x() + d2 * std::sin(tilt);
  p.s.rest = {i.carrier_x, 0.0, i.position.z() + d2 * std::cos(tilt) + lift, 0.0, M_PI_2, tilt};
  p.s.mechanism.coupling.damping = CouplingMatrix{};
  return p;
}

// derivative at the start of what a run gives, from two short runs (Richardson)
template <typename F>
double startRate(const PlaneScene& p, const F& value) {
  const auto rate = [&](double h) {
    Simulation sim(p.s);
    const double before = value(sim.state());
    EXPECT_EQ(sim.advance(h), StopReason::kOk);
    return (value(sim.state()) - before) / h;
  };
  return 2.0 * rate(1e-6) - rate(2e-6);
}

// 6.38–6.40: the gap's acceleration without the run of the contact point and without
// omega × (omega × r). In the plane it is z'' + dgap/dT T'', and (h cos T + r sin T) T'² is left
// out.
TEST(ThesisNoCentripetal, LeavesOutTheWayOfTheContact) {
  const double tilt = 0.2, spin = 2.0;
  for (const bool on : {false, true}) {
    PlaneScene p = thesisPlane(
        {"contact={law: viscous, rate: 700}", "friction={static: 0, sliding: 0}",
         "solver.tolerance=1e-14", std::string("thesis_no_centripetal=") + (on ? "true" : "false")},
        tilt, spin, -1e-3);
    p.s.initial.position.z() -= 1e-9;  // in contact
    const double left_out = (p.h * std::cos(tilt) + p.r * std::sin(tilt)) * spin * spin;
    const double rate = startRate(p, [&](const State& x) { return p.gapRate(x); });
    // differences of velocities of 0.1 m/s over 1e-6 s, and the decay of 700 1/s over it
    EXPECT_NEAR(rate, on ? left_out : 0.0, 1e-3 * left_out) << on;
  }
}

// 6.35, 6.36: a stationary point keeps the slip it has; it should come to rest with e^(−k t)
TEST(ThesisCreep, KeepsTheSlip) {
  for (const bool on : {false, true}) {
    PlaneScene p = thesisPlane(
        {"contact={law: viscous, rate: 700, stationary_rows: true}",
         "friction={static: 0.5, sliding: 0.5}", "solver.tolerance=1e-9", "solver.max_step=1e-5",
         std::string("thesis_creep=") + (on ? "true" : "false")},
        0.2, 0.0, -1e-3);
    const double slip = 2e-7;  // below what counts as slip at this tolerance [m/s]
    p.s.initial.velocity.x() = slip;
    p.s.initial.position.z() -= 1e-9;
    Simulation sim(p.s);
    for (int i = 1; i <= 8; ++i) {
      const double t = 5e-4 * i;
      ASSERT_EQ(sim.advance(t), StopReason::kOk);
      EXPECT_EQ(sim.contacts()[2].state, ContactReport::kStick);
      // steps of 10 us are far under the tolerance's velocity error, 30 1/s × 1e-9 m
      EXPECT_NEAR(p.slip(sim.state()), on ? slip : slip * std::exp(-700 * t), 0.01 * slip) << on;
    }
  }
}

// Listing, "CHECK SIGN OF FORCES": a force that would have to pull pushes as hard instead, so that
// the gap opens with twice the acceleration A it has when released
TEST(ThesisSignFlip, PushesWhereItWouldPull) {
  double rate[2];
  for (const bool on : {false, true}) {
    PlaneScene p = thesisPlane(
        {"contact={law: viscous, rate: 700}", "friction={static: 0, sliding: 0}",
         "solver.tolerance=1e-14", std::string("thesis_sign_flip=") + (on ? "true" : "false")},
        0.2, 0.0, 1e-3);
    p.s.initial.position.z() -= 1e-6;
    rate[on ? 1 : 0] = startRate(p, [&](const State& x) { return p.gapRate(x); });
    if (on) continue;
    // by hand: the coupling lifts with k_z (lift + 1e-6), the weight pulls; both act on gap and
    // tilt
    const double T = 0.2, d2 = p.s.mechanism.peg.coupling_height,
                 kz = p.s.mechanism.coupling.stiffness.diagonal(0);
    const double lift = kz * (1e-3 + 1e-6),
                 force = lift - p.s.mechanism.peg.mass * p.s.mechanism.gravity;
    const double angular = -d2 * std::sin(T) * lift / p.s.mechanism.peg.inertia_transverse;
    const double A =
        force / p.s.mechanism.peg.mass + (p.h * std::sin(T) - p.r * std::cos(T)) * angular;
    EXPECT_GT(A, 10.0);
    EXPECT_NEAR(rate[0], A, 1e-5 * A);  // springs change by 1e-12 of it, the rest is rounding
  }
  EXPECT_NEAR(rate[1] / rate[0], 2.0, 1e-5);
}

}  // namespace
}  // namespace assembly_cell
