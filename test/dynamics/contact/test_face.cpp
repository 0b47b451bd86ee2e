// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A peg whose face lies on the plane or on the floor: rest, slip, rocking, tipping, leaving,
// against closed forms and a rocking body in extended precision of this file.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "allocations.h"
#include "scenes.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

constexpr double kFloor = 0.05;  // depth of the hole [m]
const Vector3d kOnPlane(0.09, 0.02, 0.0), kOnFloor(0.0, 0.0, -kFloor);

struct Ground {
  const char* law;
  Vector3d place;
};

// The cell's peg without a coupling: nothing but weight and contact.
Scenario freePeg(const std::string& law, const Vector3d& bottom, double tilt = 0.0,
                 double lean = 0.0) {
  Scenario s = load("cell", {"contact.law=" + law, "hole.depth=0.05"});
  s.mechanism.coupling.stiffness = s.mechanism.coupling.damping = CouplingMatrix{};
  place(s, bottom + Vector3d(0, 0, s.mechanism.peg.radius * std::sin(tilt)), tilt, lean);
  return s;
}

double tiltOf(const Simulation& sim) { return sim.pegPose().R.col(2).head<2>().norm(); }

class Face : public testing::TestWithParam<Ground> {};

TEST_P(Face, RestsWithoutEvents) {
  const auto& [law, at] = GetParam();
  Simulation sim(freePeg(law, at));
  const std::uint64_t before = test::allocationsOfThisThread();
  EXPECT_EQ(sim.advance(3.0), StopReason::kOk);
  EXPECT_EQ(test::allocationsOfThisThread(), before);
  EXPECT_EQ(sim.counts().events, 0);
  EXPECT_LT((sim.pegPose().p - at).norm(), 1e-14);
  EXPECT_LT(tiltOf(sim), 1e-14);
  EXPECT_EQ(closedContacts(sim), 3);
  double load = 0.0;
  for (const ContactReport& c : sim.contacts()) {
    if (c.state == ContactReport::kOpen) continue;
    EXPECT_EQ(c.feature, ContactFeature::kEdgePlane);
    EXPECT_EQ(c.state, ContactReport::kStick);
    load += c.force.z();
  }
  EXPECT_NEAR(load, sim.scenario().mechanism.peg.mass * sim.scenario().mechanism.gravity, 1e-12);
}

// v0² / 2μg, then rest. The viscous law takes the last of the speed with its own rate.
TEST_P(Face, SlidesToRest) {
  const auto& [law, at] = GetParam();
  if (at.z() < 0.0) return;
  Scenario s = freePeg(law, at);
  s.initial.velocity = {0.12, 0.16, 0.0};
  const double braked = s.mechanism.friction.sliding_coefficient * s.mechanism.gravity;
  Simulation sim(s);
  sim.advance(0.05);
  const double way = 0.2 * 0.05 - 0.5 * braked * 0.05 * 0.05;
  EXPECT_LT((sim.pegPose().p - at - way * Vector3d(0.6, 0.8, 0)).norm(), 1e-13);
  sim.advance(0.2);
  const double all = 0.02 / braked;
  EXPECT_LT((sim.pegPose().p - at - all * Vector3d(0.6, 0.8, 0)).norm(), 2e-8);
  EXPECT_LT(kineticSpeed(sim.state()), 1e-13);
  EXPECT_LE(sim.counts().events, 2);
  EXPECT_LT(tiltOf(sim), 1e-14);
}

// A peg that falls flat has one impact; the viscous law lets it sink in by speed over rate.
TEST_P(Face, FallsFlat) {
  const auto& [law, at] = GetParam();
  Simulation sim(freePeg(law, at + Vector3d(0, 0, 1e-3)));
  EXPECT_EQ(sim.advance(0.3), StopReason::kOk);
  const Scenario& s = sim.scenario();
  const double speed = std::sqrt(2e-3 * s.mechanism.gravity);
  const bool rigid = s.contact.law == ContactLaw::kRigid;
  EXPECT_NEAR(sim.pegPose().p.z(), at.z() - (rigid ? 0.0 : speed / s.contact.rate), 1e-11);
  EXPECT_LE(sim.counts().events, 2);
  EXPECT_EQ(closedContacts(sim), 3);
}

// Pushed and turned repeatedly, slightly tilted: the energy does not increase. (The viscous
// law may push on points that leave; test/stress has its balance.)
TEST_P(Face, NeverGainsEnergy) {
  const auto& [law, at] = GetParam();
  if (std::string(law) != "rigid") return;
  for (int k = 0; k < 12; ++k) {
    Scenario s = freePeg(law, at, 1e-3 / (1 + k), 0.5 * k);
    s.initial.velocity = {0.02 * (k % 3), 0.01, 0.0};
    s.initial.euler_rates = {0.02 * (k % 2), 0.01, 1.0 * (k % 4)};
    if (at.z() < 0.0) s.initial.velocity *= 1e-2;
    const double mu = 0.2 * (1 + k % 4);
    s.mechanism.friction = {mu, mu};
    Simulation sim(s);
    double lowest = sim.energy();
    // its weight over a tolerance
    const double error = s.mechanism.peg.mass * s.mechanism.gravity * s.solver.tolerance;
    while (sim.time() < 0.05) {
      ASSERT_EQ(sim.advance(0.05, 1), StopReason::kOk) << k;
      EXPECT_LT(sim.energy(), lowest + error) << k << " at " << sim.time();
      lowest = std::min(lowest, sim.energy());
    }
    EXPECT_LT(sim.counts().evaluations, 400000) << k;
  }
}

// Pulled up through the coupling it leaves once the pull is its weight, and doesn't tilt.
TEST_P(Face, IsLiftedOff) {
  const auto& [law, at] = GetParam();
  Scenario s = load("cell", {std::string("contact.law=") + law, "hole.depth=0.05"});
  place(s, at, 0.0, 0.0);
  const double sag =
      s.mechanism.peg.mass * s.mechanism.gravity / s.mechanism.coupling.stiffness.diagonal(0);
  Simulation sim(s);
  RestPose rest = sim.rest();
  rest.z += 0.99 * sag;
  sim.setRestTarget(rest);
  sim.advance(1.0);
  EXPECT_EQ(closedContacts(sim), 3);
  EXPECT_NEAR(sim.pegPose().p.z(), at.z(), 1e-9);
  rest.z += 0.02 * sag;
  sim.setRestTarget(rest);
  sim.advance(2.0);
  EXPECT_EQ(closedContacts(sim), 0);
  EXPECT_NEAR(sim.pegPose().p.z() - at.z(), 0.01 * sag, 1e-4 * sag);
  EXPECT_LT(tiltOf(sim), 1e-9);
  EXPECT_LT(sim.counts().events, 30);
}

INSTANTIATE_TEST_SUITE_P(Laws, Face,
                         testing::Values(Ground{"rigid", kOnPlane}, Ground{"rigid", kOnFloor},
                                         Ground{"viscous", kOnPlane}, Ground{"viscous", kOnFloor}),
                         [](const auto& test) {
                           return std::string(test.param.law) +
                                  (test.param.place.z() < 0.0 ? "_floor" : "_plane");
                         });

// Regularised friction: a viscous face creeps below v_ST and rests across; on springs it sinks
// in by a third of the load each, lifted and dropped as well.
TEST(FaceRegularised, Rests) {
  for (const double height : {0.0, 1e-4}) {
    Scenario s = freePeg("viscous", kOnPlane + Vector3d(0, 0, height));
    s.contact.stationary_rows = false;
    Simulation viscous(s);
    EXPECT_EQ(viscous.advance(0.5), StopReason::kOk);
    EXPECT_NEAR(viscous.pegPose().p.z(),
                -std::sqrt(2 * s.mechanism.gravity * height) / s.contact.rate, 1e-9);
    EXPECT_LE(viscous.counts().events, 2);
    EXPECT_LT(viscous.counts().evaluations, 40000);
    EXPECT_EQ(closedContacts(viscous), 3);
    EXPECT_LT(tiltOf(viscous), 1e-11);

    s.contact.law = ContactLaw::kSpringDashpot;
    s.contact.stiffness = 1e6;
    s.contact.damping = 500;
    s.solver.max_step = 2e-4;  // at 1e-3 s, nearly unstable on these springs, rest is by tolerance
    Simulation springs(s);
    const double energy = springs.energy();
    EXPECT_EQ(springs.advance(0.5), StopReason::kOk);
    EXPECT_EQ(closedContacts(springs), 3);
    EXPECT_LT(kineticSpeed(springs.state()), 1e-9);
    EXPECT_LT(springs.energy(), energy);
    EXPECT_LT(springs.counts().events, 300);
    if (height > 0.0) continue;
    const double sunk = s.mechanism.peg.mass * s.mechanism.gravity / (3 * s.contact.stiffness);
    EXPECT_NEAR(springs.pegPose().p.z(), -sunk, 1e-10);
    EXPECT_LE(springs.counts().events, 2);
  }
}

// A plane body that rocks about one end of its base and the other, without slip: the angular
// momentum about the new end stays. Extended precision; Runge–Kutta between impacts. Leans first
// towards the end that is `ahead` of the middle; the other is `behind` it.
class Rocking {
 public:
  Rocking(const PegParameters& peg, double gravity, double tilt, double ahead, double behind)
      : ends_{ahead, behind},
        h_(peg.half_height),
        mass_(peg.mass),
        inertia_(peg.inertia_transverse),
        weight_(peg.mass * gravity),
        tilt_(tilt) {}
  Rocking(const PegParameters& peg, double gravity, double tilt)
      : Rocking(peg, gravity, tilt, peg.radius, peg.radius) {}

  void advance(long double t_end) {
    constexpr long double kStep = 1e-6L;
    while (t_ < t_end && !lies_) {
      const long double h = std::min(kStep, t_end - t_);
      long double tilt = tilt_, rate = rate_;
      step(h, tilt, rate);
      if (tilt >= 0.0L) {
        t_ += h;
        tilt_ = tilt;
        rate_ = rate;
        continue;
      }
      strike(h);
    }
    t_ = std::max(t_, t_end);
  }
  // of the centre of mass: towards the first lean, up
  std::array<long double, 2> centre() const {
    const long double r = ends_[on_];
    const long double out = r - r * std::cos(tilt_) + h_ * std::sin(tilt_);
    return {on_ == 0 ? out : -out, r * std::sin(tilt_) + h_ * std::cos(tilt_)};
  }
  int impacts() const { return impacts_; }
  bool lies() const { return lies_; }

 private:
  long double acceleration(long double tilt) const {
    const long double r = ends_[on_], about_end = inertia_ + mass_ * (r * r + h_ * h_);
    return -weight_ / about_end * (r * std::cos(tilt) - h_ * std::sin(tilt));
  }
  void step(long double h, long double& tilt, long double& rate) const {
    const long double a1 = acceleration(tilt), v2 = rate + h / 2 * a1;
    const long double a2 = acceleration(tilt + h / 2 * rate), v3 = rate + h / 2 * a2;
    const long double a3 = acceleration(tilt + h / 2 * v2), v4 = rate + h * a3;
    const long double a4 = acceleration(tilt + h * v3);
    tilt += h / 6 * (rate + 2 * v2 + 2 * v3 + v4);
    rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  void strike(long double high) {
    long double low = 0.0L, tilt = 0.0L, rate = 0.0L;
    for (int i = 0; i < 80; ++i) {
      const long double middle = (low + high) / 2;
      tilt = tilt_;
      rate = rate_;
      step(middle, tilt, rate);
      (tilt < 0.0L ? high : low) = middle;
    }
    t_ += low;
    tilt_ = 0.0L;
    const long double r = ends_[1 - on_];
    const long double kept =
        (inertia_ + mass_ * (h_ * h_ - r * ends_[on_])) / (inertia_ + mass_ * (r * r + h_ * h_));
    rate_ = -kept * rate;
    on_ = 1 - on_;
    ++impacts_;
    lies_ = rate_ < 1e-12L;
  }

  const std::array<long double, 2> ends_;
  const long double h_, mass_, inertia_, weight_;
  long double t_ = 0.0L, tilt_, rate_ = 0.0L;
  int on_ = 0, impacts_ = 0;
  bool lies_ = false;
};

// Runs both, leaning in this direction, for so many milliseconds: the largest distance of their
// centres of mass [m]. Energy never rises.
double rockBoth(Simulation& sim, Rocking& reference, double direction, int milliseconds) {
  const double half_height = sim.scenario().mechanism.peg.half_height;
  const auto middle = [&]() -> Vector3d {
    return sim.pegPose().p + half_height * sim.pegPose().R.col(2);
  };
  const Vector3d start = middle(), towards(std::cos(direction), std::sin(direction), 0.0);
  const auto first = reference.centre();
  double error = 0.0, energy = sim.energy();
  for (int i = 1; i <= milliseconds; ++i) {
    EXPECT_EQ(sim.advance(1e-3 * i), StopReason::kOk);
    reference.advance(1e-3 * i);
    const auto now = reference.centre();
    const Vector3d wanted = start + static_cast<double>(now[0] - first[0]) * towards +
                            Vector3d(0, 0, static_cast<double>(now[1] - first[1]));
    error = std::max(error, (middle() - wanted).norm());
    EXPECT_LE(sim.energy(), energy + 1e-15);
    energy = sim.energy();
  }
  std::printf("%.1f, tolerance %.0e: %.1e m, %lld events, %d impacts\n", direction,
              sim.scenario().solver.tolerance, error, static_cast<long long>(sim.counts().events),
              reference.impacts());
  return error;
}

// To its end.
TEST(FaceRocking, IsThatOfARockingBody) {
  constexpr double kTilt = 2e-3;
  for (const double lean : {0.0, 0.3, 2.5}) {
    for (const double tolerance : {1e-9, 1e-10, 1e-11}) {
      Scenario s = freePeg("rigid", kOnPlane, kTilt, lean);
      s.mechanism.friction = {0.8, 0.8};
      s.solver.tolerance = tolerance;
      Simulation sim(s);
      Rocking reference(s.mechanism.peg, s.mechanism.gravity, kTilt);
      EXPECT_LT(rockBoth(sim, reference, lean, 40), 2 * tolerance);
      EXPECT_GT(reference.impacts(), 10);
      EXPECT_LT(sim.counts().events, 40);
      EXPECT_EQ(closedContacts(sim), 3);
      EXPECT_LT(tiltOf(sim), 1e-12);
    }
  }
}

// A slender body rocks longer: of a hundred impacts none is left out, and it lies at the end.
TEST(FaceRocking, OfASlenderPegEnds) {
  Scenario s = freePeg("rigid", kOnPlane);
  PegParameters& peg = s.mechanism.peg;
  peg.half_height = 0.1;
  peg.inertia_transverse = peg.mass * (peg.radius * peg.radius / 4 + 0.04 / 12);
  place(s, kOnPlane + Vector3d(0, 0, peg.radius * std::sin(2e-3)), 2e-3, 1.0);
  s.mechanism.friction = {0.8, 0.8};
  Simulation sim(s);
  Rocking reference(peg, s.mechanism.gravity, 2e-3);
  sim.advance(0.4);
  reference.advance(0.4L);
  EXPECT_NEAR(sim.pegPose().p.z() + 0.1, static_cast<double>(reference.centre()[1]), 2e-9);
  EXPECT_EQ(closedContacts(sim), 3);
  EXPECT_LT(tiltOf(sim), 1e-12);
  EXPECT_LT(sim.counts().events, 400);
}

// Pulled sideways at the coupling it tips about its edge once the moment is that of its weight.
TEST(FaceTipping, BeginsWhereTheWeightIsAtTheEdge) {
  for (const char* law : {"rigid", "viscous"}) {
    for (const double direction : {0.0, 0.7, 4.0}) {
      Scenario s = load("cell", {std::string("contact.law=") + law});
      place(s, kOnPlane, 0.0, 0.0);
      s.mechanism.coupling.stiffness = s.mechanism.coupling.damping = CouplingMatrix{};
      s.mechanism.coupling.stiffness.diagonal << 0, 2e3, 2e3, 0, 0, 0;
      s.mechanism.friction = {0.8, 0.8};
      const PegParameters& peg = s.mechanism.peg;
      const double arm = peg.half_height + peg.coupling_height;
      const double way = peg.mass * s.mechanism.gravity * peg.radius / arm *
                         (1 / 2e3 + 1 / s.mechanism.carrier.stiffness(0));
      Simulation sim(s);
      RestPose rest = sim.rest();
      const RestPose from = rest;
      const auto pull = [&](double share, double t) {
        rest.x = from.x + share * way * std::cos(direction);
        rest.y = from.y + share * way * std::sin(direction);
        sim.setRestTarget(rest, 2e-3);
        EXPECT_EQ(sim.advance(t), StopReason::kOk);
      };
      pull(0.99, 1.0);
      EXPECT_LT(tiltOf(sim), 1e-7) << law << direction;
      EXPECT_LT(kineticSpeed(sim.state()), 1e-6);
      EXPECT_LE(sim.counts().events, 2);
      pull(1.01, 1.02);
      EXPECT_GT(tiltOf(sim), 1e-6) << law << direction;
      // towards the pull
      const Vector3d axis = sim.pegPose().R.col(2);
      EXPECT_NEAR(std::remainder(std::atan2(axis.y(), axis.x()) - direction, 2 * M_PI), 0.0, 1e-3);
      // lies and leaves some times as it begins, by rounding: 4 to 58 with steps of any length
      EXPECT_LT(sim.counts().events, 100) << law << direction;
    }
  }
}

// A face that reaches over the hole, so far off its axis in this direction: on the arc of its edge
// beside the hole and the chord between the crossings of edge and rim.
struct OverHole {
  double off, about;
  Vector3d place() const { return off * Vector3d(std::cos(about), std::sin(about), 0.0); }
  // of the chord, towards the hole [m]
  double chord(const Scenario& s) const {
    const double r = s.mechanism.peg.radius, R = s.mechanism.hole.radius;
    return (off * off + r * r - R * R) / (2.0 * off);
  }
};

TEST(FaceOverTheHole, Rests) {
  for (const OverHole at : {OverHole{0.004, 0.3}, OverHole{0.012, -2.0}, OverHole{0.035, 1.5}}) {
    for (const char* law : {"viscous", "rigid"}) {
      Simulation sim(freePeg(law, at.place()));
      sim.advance(0.01);
      const std::uint64_t before = test::allocationsOfThisThread();
      EXPECT_EQ(sim.advance(3.0), StopReason::kOk);
      EXPECT_EQ(test::allocationsOfThisThread(), before);
      EXPECT_LE(sim.counts().events, 4) << at.off;
      // within what counts as lying
      EXPECT_LT((sim.pegPose().p - at.place()).norm(), 1e-9);
      EXPECT_LT(tiltOf(sim), 4e-8);
      EXPECT_EQ(closedContacts(sim), 3);
      // weight and moments
      const PegParameters& peg = sim.scenario().mechanism.peg;
      Vector3d force = Vector3d::Zero(), moment = Vector3d::Zero();
      int crossings = 0;
      for (const ContactReport& c : sim.contacts()) {
        if (c.state == ContactReport::kOpen) continue;
        EXPECT_EQ(c.state, ContactReport::kStick);
        EXPECT_GE(c.force.z(), 0.0);
        crossings += c.feature == ContactFeature::kEdgeEdge ? 1 : 0;
        force += c.force;
        moment += (c.point - at.place()).cross(c.force);
      }
      EXPECT_NEAR(force.z(), peg.mass * sim.scenario().mechanism.gravity, 1e-9);
      EXPECT_LT(moment.norm(), 1e-9);
      EXPECT_EQ(crossings, 2);
    }
  }
}

// About the edge beside the hole and the chord: impacts between them to the end, against the plane
// body. Points of the edge that meet the rim move along both as the peg tilts, by up to
// r tilt²/2 = 5e-8 m, which the plane body has not: a fifth of that is allowed.
TEST(FaceOverTheHole, RocksAsAPlaneBody) {
  constexpr double kTilt = 2e-3;
  for (const OverHole at : {OverHole{0.012, 0.3}, OverHole{0.02, -2.0}, OverHole{0.035, 1.5}}) {
    for (const double tolerance : {1e-9, 1e-11}) {
      Scenario s = freePeg("rigid", at.place(), kTilt, at.about);
      s.mechanism.friction = {0.8, 0.8};
      s.solver.tolerance = tolerance;
      Simulation sim(s);
      const double r = s.mechanism.peg.radius;
      Rocking reference(s.mechanism.peg, s.mechanism.gravity, kTilt, r, at.chord(s));
      EXPECT_LT(rockBoth(sim, reference, at.about, 60), 1e-8);
      EXPECT_GT(reference.impacts(), 2);
      EXPECT_EQ(sim.counts().zeno_phases, 0);
      EXPECT_LT(sim.counts().events, 100);
      if (!reference.lies()) continue;
      EXPECT_EQ(closedContacts(sim), 3);
      EXPECT_LT(tiltOf(sim), 1e-11);
    }
  }
}

TEST(FaceOverTheHole, TipsWhereTheWeightIsAtItsEnd) {
  const OverHole at{0.012, 0.4};
  // from away from the hole: its edge twice, the chord twice
  for (const char* law : {"viscous", "rigid"}) {
    for (const double direction : {0.0, 1.2, 2.6, M_PI}) {
      Scenario s = load("cell", {std::string("contact.law=") + law});
      place(s, at.place(), 0.0, 0.0);
      s.mechanism.coupling.stiffness = s.mechanism.coupling.damping = CouplingMatrix{};
      s.mechanism.coupling.stiffness.diagonal << 0, 2e3, 2e3, 0, 0, 0;
      s.mechanism.friction = {0.8, 0.8};
      const PegParameters& peg = s.mechanism.peg;
      const double end = std::min(peg.radius, at.chord(s) / std::max(1e-9, -std::cos(direction)));
      const double arm = peg.half_height + peg.coupling_height;
      const double way = peg.mass * s.mechanism.gravity * end / arm *
                         (1 / 2e3 + 1 / s.mechanism.carrier.stiffness(0));
      Simulation sim(s);
      RestPose rest = sim.rest();
      const RestPose from = rest;
      const auto pull = [&](double share, double t) {
        rest.x = from.x + share * way * std::cos(at.about + direction);
        rest.y = from.y + share * way * std::sin(at.about + direction);
        sim.setRestTarget(rest, 2e-3);
        EXPECT_EQ(sim.advance(t), StopReason::kOk);
      };
      pull(0.98, 1.0);
      EXPECT_LT(tiltOf(sim), 1e-7) << direction;
      EXPECT_LT(kineticSpeed(sim.state()), 1e-6);
      EXPECT_LE(sim.counts().events, 12) << direction;
      // where it begins, far over the tilt of what counts as lying: later it slides and turns
      for (double t = 1.0; tiltOf(sim) < 1e-5 && t < 1.1; t += 1e-3) pull(1.02, t);
      EXPECT_GT(tiltOf(sim), 1e-5) << direction;
      const Vector3d axis = sim.pegPose().R.col(2);
      const double towards = direction < 2.0 ? direction : M_PI;  // about the chord
      EXPECT_NEAR(std::remainder(std::atan2(axis.y(), axis.x()) - at.about - towards, 2 * M_PI),
                  0.0, 1e-2)
          << direction;
      EXPECT_LT(sim.counts().events, 150) << direction;
    }
  }
}

// v0² / 2μg towards the hole: the chord comes nearer, the friction is that of the whole weight.
TEST(FaceOverTheHole, SlidesToRest) {
  for (const char* law : {"viscous", "rigid"}) {
    Scenario s = freePeg(law, {0.03, 0.0, 0.0});
    s.initial.velocity = {-0.12, 0.0, 0.0};
    const double braked = s.mechanism.friction.sliding_coefficient * s.mechanism.gravity;
    Simulation sim(s);
    sim.advance(0.03);
    const double way = 0.12 * 0.03 - 0.5 * braked * 0.03 * 0.03;
    EXPECT_NEAR(sim.pegPose().p.x(), 0.03 - way, 1e-9);
    sim.advance(0.3);
    EXPECT_NEAR(sim.pegPose().p.x(), 0.03 - 0.0072 / braked, 1e-7);
    EXPECT_LT(tiltOf(sim), 4e-8);
    EXPECT_LT(kineticSpeed(sim.state()), 1e-9);
    EXPECT_LE(sim.counts().events, 10);
  }
}

// Pressed down by the cell's coupling and leaning a little it comes to rest without event
// accumulation.
TEST(FaceOverTheHole, ComesDownFromRocking) {
  for (const char* law : {"viscous", "rigid"}) {
    for (const double lean : {0.0, 1.0, 2.0, 3.0}) {
      Scenario s = load("cell", {std::string("contact.law=") + law});
      place(s, {0.006, 0.0, 0.0}, 5e-4, lean);
      s.initial.close = true;
      s.rest.z -= 3e-4;
      Simulation sim(s);
      EXPECT_EQ(sim.advance(0.3), StopReason::kOk);
      std::printf("lean %.0f: %lld events, %lld steps\n", lean,
                  static_cast<long long>(sim.counts().events),
                  static_cast<long long>(sim.counts().steps));
      EXPECT_LT(sim.counts().events, 200) << lean;
      EXPECT_EQ(sim.counts().zeno_phases, 0);
    }
  }
}

}  // namespace
}  // namespace assembly_cell
