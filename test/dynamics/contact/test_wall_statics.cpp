// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contacts inside the hole against closed forms of this file: a peg that slides down flat along the
// wall, and pegs that lean at rest under springs against wall, rim and plane. Plane motion in x, z.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

constexpr double kUpright = 1.5707963267948966;

Scenario cell(const std::vector<std::string>& overrides) {
  std::vector<std::string> all = {
      "hole.depth=0.2", "solver.tolerance=1e-12",
      "contact.features=[edge_edge, edge_plane, edge_wall, rim_side, rim_face, edge_cone]"};
  all.insert(all.end(), overrides.begin(), overrides.end());
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml", all);
}

// Flat against the wall two places carry, the bottom edge and the rim; together they press with the
// push F, and friction takes mu F / m from the fall: z'' = −g + mu F / m.
TEST(WallStatics, SlidesDownTheWall) {
  Scenario s = cell({"contact={law: rigid}", "peg.exciter_height=0.01", "push=[2, 0, 0]",
                     "friction={static: 0.2, sliding: 0.2}"});
  s.mechanism.coupling = CouplingParameters{};
  s.mechanism.carrier.stiffness.setZero();
  s.initial = InitialState{};
  s.initial.euler = {0.0, kUpright, 0.0};
  const double start = -0.02, speed = -0.01;
  s.initial.position = Vector3d(s.mechanism.hole.radius - s.mechanism.peg.radius, 0.0, start);
  s.initial.velocity = Vector3d(0, 0, speed);
  const double fall = -s.mechanism.gravity + 0.2 * 2.0 / s.mechanism.peg.mass;
  Simulation sim(s);
  for (int i = 1; i <= 10; ++i) {
    const double t = 0.003 * i;
    ASSERT_EQ(sim.advance(t), StopReason::kOk);
    // exact for every method: rounding only
    EXPECT_NEAR(sim.state().q(0), start + t * (speed + 0.5 * fall * t), 1e-13) << t;
    EXPECT_NEAR(sim.state().q(1), s.mechanism.hole.radius - s.mechanism.peg.radius, 1e-13) << t;
    EXPECT_NEAR(sim.state().q(3), 0.0, 1e-12) << t;
  }
  // moments about the centre of mass: (d1 + h − mu r) F = (h − z) N_rim, the wall has the rest
  double pressed = 0.0, at_rim = 0.0;
  for (const ContactReport& c : sim.contacts()) {
    if (c.state == ContactReport::kOpen) continue;
    EXPECT_NEAR(c.normal.x(), -1.0, 1e-12);
    pressed -= c.force.x();
    if (c.feature == ContactFeature::kRimSide) at_rim -= c.force.x();
  }
  const double h = s.mechanism.peg.half_height, z = sim.state().q(0);
  EXPECT_NEAR(pressed, 2.0, 1e-9);
  EXPECT_NEAR(at_rim, 2.0 * (0.01 + h - 0.2 * s.mechanism.peg.radius) / (h - z), 1e-9);
}

// ---- at rest under springs: V(x, z, tilt) least where the gap is zero (or −N/K) ----

struct Rest {
  double x, z, tilt, N;
};
using Gap = std::function<long double(long double, long double, long double)>;

// no friction: dV = N d(gap), gap = −N / stiffness. The carrier is a spring in series.
Rest equilibrium(const Scenario& s, const Gap& gap, double stiffness, Rest start) {
  using Real = long double;
  using Vector = Eigen::Matrix<Real, 4, 1>;
  const Real kx = s.mechanism.coupling.stiffness.diagonal(1), kc = s.mechanism.carrier.stiffness(0);
  const Real k = kx * kc / (kx + kc), kz = s.mechanism.coupling.stiffness.diagonal(0),
             kr = s.mechanism.coupling.stiffness.diagonal(5), d2 = s.mechanism.peg.coupling_height,
             weight = static_cast<Real>(s.mechanism.peg.mass) * s.mechanism.gravity;
  const auto residual = [&](const Vector& u) {
    const Real x = u(0), z = u(1), T = u(2), N = u(3), e = 1e-6L;
    const Real fx = k * (x + d2 * std::sin(T) - s.rest.x);
    const Real fz = kz * (z + d2 * std::cos(T) - s.rest.z);
    Vector r;
    // the gap's derivatives by differences of fourth order, exact to 1e-18
    const auto slope = [&](Real a, Real b, Real c) {
      const auto g = [&](Real m) { return gap(x + m * a, z + m * b, T + m * c); };
      return (8 * (g(e) - g(-e)) - (g(2 * e) - g(-2 * e))) / (12 * e);
    };
    r << fx - N * slope(1, 0, 0), fz + weight - N * slope(0, 1, 0),
        d2 * (std::cos(T) * fx - std::sin(T) * fz) + kr * (T - s.rest.phi) - N * slope(0, 0, 1),
        gap(x, z, T) + (std::isfinite(stiffness) ? N / stiffness : Real(0));
    return r;
  };
  Vector u(start.x, start.z, start.tilt, start.N);
  for (int i = 0; i < 30; ++i) {
    const Vector r = residual(u);
    Eigen::Matrix<Real, 4, 4> J;
    for (int j = 0; j < 4; ++j) {
      Vector shifted = u;
      shifted(j) += 1e-7L;
      J.col(j) = (residual(shifted) - r) / 1e-7L;
    }
    u -= J.fullPivLu().solve(r);
  }
  EXPECT_LT(static_cast<double>(residual(u).norm()), 1e-12);
  return {static_cast<double>(u(0)), static_cast<double>(u(1)), static_cast<double>(u(2)),
          static_cast<double>(u(3))};
}

struct Lean {
  const char* name;
  ContactFeature feature;
  Gap gap;
  Vector3d bottom;  // bottom centre at the start
  double tilt;
  Vector3d pull;  // of the rest pose: x, z, tilt
  bool chamfered = false;
};

constexpr double kWidth = 2e-3, kAngle = 0.6;  // of the chamfer

std::vector<Lean> leans(const Scenario& s) {
  using Real = long double;
  const Real R = s.mechanism.hole.radius, r = s.mechanism.peg.radius,
             h = s.mechanism.peg.half_height;
  return {{"edge on the plane",
           ContactFeature::kEdgePlane,
           [=](Real, Real z, Real T) { return z - h * std::cos(T) - r * std::sin(T); },
           {0.08, 0, 0.0052},
           0.2,
           {0.0, -4e-4, 0.02}},
          {"edge on the wall",
           ContactFeature::kEdgeWall,
           [=](Real x, Real, Real T) { return R - (x - h * std::sin(T) + r * std::cos(T)); },
           {3e-4, 0, -0.01},
           -0.02,
           {6e-4, 0.0, -0.01}},
          {"rim on the side",
           ContactFeature::kRimSide,
           [=](Real x, Real z, Real T) { return (R - x) * std::cos(T) + z * std::sin(T) - r; },
           {2e-4, 0, -0.01},
           0.03,
           {6e-4, 0.0, 0.0}},
          {"edge on the chamfer",
           ContactFeature::kEdgeCone,
           [=](Real x, Real z, Real T) {
             return std::sin(Real(kAngle)) * (z - h * std::cos(T) - r * std::sin(T)) +
                    std::cos(Real(kAngle)) * (R + kWidth - (x - h * std::sin(T) + r * std::cos(T)));
           },
           {1.3e-3, 0, -5e-4},
           0.01,
           {1.2e-3, -1e-3, 0.0},
           true},
          {"lower edge of the chamfer on the side",
           ContactFeature::kRimSide,
           [=](Real x, Real z, Real T) {
             return (R - x) * std::cos(T) + (z + kWidth / std::tan(Real(kAngle))) * std::sin(T) - r;
           },
           {2e-4, 0, -0.015},
           0.03,
           {6e-4, 0.0, 0.0},
           true}};
}

TEST(WallStatics, LeansAtRestUnderSprings) {
  for (const bool rigid : {true, false}) {
    Scenario s = cell({"friction={static: 0, sliding: 0}", "hole.radius=0.0256",
                       rigid ? "contact={law: rigid}"
                             : "contact={law: spring_dashpot, stiffness: 1e5, damping: 200}"});
    // near critical, so that 0.3 s settle to rounding
    s.mechanism.coupling.stiffness.k26 = s.mechanism.coupling.stiffness.k35 = 0.0;
    s.mechanism.coupling.damping.diagonal << 150, 150, 150, 0.1, 0.2, 0.2;
    for (const Lean& lean : leans(s)) {
      const std::string what = std::string(lean.name) + (rigid ? ", rigid" : ", spring_dashpot");
      const Vector3d axis(std::sin(lean.tilt), 0.0, std::cos(lean.tilt));
      s.mechanism.hole.chamfer_width = lean.chamfered ? kWidth : 0.0;
      s.mechanism.hole.chamfer_angle = kAngle;
      s.initial = InitialState{};
      s.initial.euler = {lean.tilt, kUpright, 0.0};
      s.initial.position = lean.bottom + s.mechanism.peg.half_height * axis;
      const Vector3d at = s.initial.position + s.mechanism.peg.coupling_height * axis;
      s.rest = {at.x() + lean.pull(0),   0.0, at.z() + lean.pull(1), 0.0, kUpright,
                lean.tilt + lean.pull(2)};
      s.initial.carrier_x = s.rest.x;
      Simulation sim(s);
      ASSERT_EQ(sim.advance(0.5), StopReason::kOk) << what;
      const Vector9& q = sim.state().q;
      const Rest rest = equilibrium(s, lean.gap, rigid ? HUGE_VAL : s.contact.stiffness,
                                    {q(1), q(0), q(3), 10.0});
      EXPECT_GT(rest.N, 1.0) << what;
      // 1e-11 m is what remains of the motion; stiffness of 5e4 N/m makes 1e-6 N of it
      EXPECT_NEAR(q(1), rest.x, 1e-11) << what;
      EXPECT_NEAR(q(0), rest.z, 1e-11) << what;
      EXPECT_NEAR(q(3), rest.tilt, 1e-9) << what;
      double N = 0.0;
      for (const ContactReport& c : sim.contacts()) {
        if (c.state == ContactReport::kOpen) continue;
        EXPECT_EQ(c.feature, lean.feature) << what;
        N += c.force.norm();
      }
      EXPECT_NEAR(N, rest.N, 1e-6 * rest.N) << what;
    }
  }
}

}  // namespace
}  // namespace assembly_cell
