// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// 4.7–4.9 and 4.16 in the scene that they describe, simulated with nine degrees of freedom: equal
// rotational springs and nothing else (about the contact or any other point), no weight, exciter at
// the top (d1 = h). A soft stretched spring at the bottom centre presses without turning the peg.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>

#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/steady_state.h"
#include "support/expect_close.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Vector3d;
constexpr double kRadius = 0.025, kHalfHeight = 0.030, kPegMass = 0.395, kStiffness = 50;
constexpr double kPegChord = kRadius / 2;  // half contact angle 60°
constexpr double kPress = 2, kForce = 0.05, kTilt = 1e-3;

struct VibratedScene {
  Eigen::Vector3cd rotation = Eigen::Vector3cd::Zero();  // phasors of e^{i w t}
  int closed = 0;                                        // contacts, all sticking all the time
};

// Peg leaning by kTilt toward the azimuth `lean` over two crossings of the edges at ±60°, which
// carry `at` together; harmonic of its rotation after the transient.
VibratedScene vibrateScene(double lean, const Vector3d& at, int contacts, double w) {
  Scenario s;
  s.mechanism.gravity = 0;
  s.mechanism.peg = {kRadius,
                     kHalfHeight,
                     kPegMass,
                     centroidInertia(kPegMass, kRadius, kHalfHeight),
                     kPegMass * kRadius * kRadius / 2,
                     -kHalfHeight,
                     kHalfHeight};
  s.mechanism.hole.radius = kRadius;
  s.mechanism.carrier.mass = s.mechanism.carrier.inertia = 1e6;
  s.mechanism.carrier.stiffness = {1e12, 1e12, 1e12};
  s.mechanism.carrier.damping = {1e9, 1e9, 1e9};
  // damping of 0.2 % moves phases by less than 0.6° away from resonance, and transients decay in 2
  // s
  const double damping =
      0.004 * std::sqrt(kStiffness * chordInertia(kPegMass, kRadius, kHalfHeight, 0));
  const double pull = 10;
  s.mechanism.coupling.stiffness.diagonal << pull, 0, 0, kStiffness, kStiffness, kStiffness;
  s.mechanism.coupling.damping.diagonal << 0.1, 0, 0, damping, damping, damping;
  // rotation of the peg, and of the springs' rest, which carries the moment of the press
  const Vector3d tilt = kTilt * Vector3d(-std::sin(lean), std::cos(lean), 0);
  const Vector3d rest = tilt - kPress / kStiffness * Vector3d(at.y(), -at.x(), 0);
  s.rest.x = s.initial.carrier_x = -2 * kPegChord;
  s.rest.z = -kPress / pull;
  s.rest.phi = rest.y();
  s.rest.theta = M_PI / 2 + rest.x();
  const Vector3d axis(std::sin(tilt.y()) * std::cos(tilt.x()), -std::sin(tilt.x()),
                      std::cos(tilt.y()) * std::cos(tilt.x()));
  s.initial.euler = {tilt.y(), M_PI / 2 + tilt.x(), 0};
  s.initial.position = Vector3d(-2 * kPegChord, 0, 1e-4) + kHalfHeight * axis;
  s.initial.close = true;
  s.mechanism.friction = {1, 1};
  s.contact.law = ContactLaw::kRigid;
  s.mechanism.exciter = {kForce, w, 0, 1};
  s.solver.tolerance = 1e-10;
  Simulation simulation(s);
  const double period = 2 * M_PI / w;
  const double start = std::ceil(12 / period) * period;
  EXPECT_EQ(simulation.advance(start), StopReason::kOk);
  constexpr int kSamples = 400, kPeriods = 10;
  VibratedScene v;
  for (int k = 0; k < kSamples; ++k) {
    const double t = start + kPeriods * period * k / kSamples;
    EXPECT_EQ(simulation.advance(t), StopReason::kOk);
    const State& x = simulation.state();
    v.rotation += 2.0 / kSamples * Vector3d(x.q[4], x.q[3], x.q[5]) * std::polar(1.0, -w * t);
    v.closed = 0;
    for (const ContactReport& c : simulation.contacts()) {
      v.closed += c.valid && c.state == ContactReport::kStick;
    }
    EXPECT_EQ(v.closed, contacts) << t;
  }
  return v;
}

TEST(EquivalentScene, SingleContact) {
  const double alpha = M_PI / 3, sa = std::sin(alpha), ca = std::cos(alpha);
  const double beta = contactInertia(kPegMass, kRadius, kHalfHeight).beta;
  const double sb = std::sin(beta), cb = std::cos(beta);
  const Vector3d axes[] = {{sa, -ca, 0}, {ca * cb, sa * cb, sb}, {-ca * sb, -sa * sb, cb}};
  for (const double w : {100.0, 180.0, 400.0}) {
    const VibratedScene v = vibrateScene(0.5, kRadius * Vector3d(ca, sa, 0), 1, w);
    const auto model = [&](double t) {
      return singleContact({kPegMass, kRadius, kHalfHeight, kStiffness, kForce, w, alpha}, t);
    };
    const ContactRotation now = model(0), later = model(M_PI / (2 * w));
    const Complex theta[] = {{now.theta_x, -later.theta_x},
                             {now.theta_y, -later.theta_y},
                             {now.theta_z, -later.theta_z}};
    for (int k = 0; k < 3; ++k) {
      expectClose(axes[k].cast<Complex>().dot(v.rotation), theta[k], v.rotation.norm(),
                  std::to_string(w) + " axis " + std::to_string(k));
    }
  }
}

TEST(EquivalentScene, DoubleContact) {
  for (const double w : {100.0, 180.0, 400.0}) {
    const VibratedScene v = vibrateScene(0, Vector3d(kPegChord, 0, 0), 2, w);
    const double theta =
        doubleContact(kForce, kHalfHeight, kStiffness,
                      chordInertia(kPegMass, kRadius, kHalfHeight, kPegChord), w, 0);
    expectClose(v.rotation.y(), theta, theta, std::to_string(w));
    EXPECT_LT(std::abs(v.rotation.x()) + std::abs(v.rotation.z()), 0.01 * std::abs(theta));
  }
}

}  // namespace
}  // namespace assembly_cell
