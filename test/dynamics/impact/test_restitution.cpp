// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Stronge's restitution against the closed form of a bar that strikes the plane with one point: a
// peg without coupling and weight whose motion stays in the plane x, z. The forms are of this file,
// from mass, inertia and lever alone.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "../../../benchmark/support/reference_impact.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

struct Planar {
  double x = 0.0, z = 0.0;
};

// the bar: lever of the lowest point, and velocities of that point by unit impulses
struct Bar {
  double m, I, rx, rz;
  double xx() const { return 1 / m + rz * rz / I; }
  double zz() const { return 1 / m + rx * rx / I; }
  double xz() const { return -rx * rz / I; }
};

// Piecewise straight in the normal impulse: slip, its end, then rest or slip the other way.
struct Outcome {
  Planar impulse;
  double compression = 0.0, restitution = 0.0;  // work of the normal force
  int pieces = 0;
};
Outcome strike(const Bar& b, Planar v, double mu, double e) {
  Outcome out;
  double owed = 0.0, work = 0.0;
  bool back = false;
  while (out.pieces < 6) {
    ++out.pieces;
    // tangential impulse a unit of normal impulse
    double f;
    const double hold = -b.xz() / b.xx();
    if (v.x != 0.0) {
      f = v.x > 0 ? -mu : mu;
    } else {
      f = std::abs(hold) <= mu ? hold : std::copysign(mu, hold);
    }
    const double dx = b.xz() + b.xx() * f, dz = b.zz() + b.xz() * f;
    const double stop = v.x * dx < 0 ? -v.x / dx : HUGE_VAL;
    const double end = back ? (-v.z + std::sqrt(v.z * v.z + 2 * dz * owed)) / dz : -v.z / dz;
    const double p = std::min(stop, end);
    work += p * (v.z + 0.5 * dz * p);
    out.impulse.x += f * p;
    out.impulse.z += p;
    v.x = stop <= end ? 0.0 : v.x + dx * p;
    v.z += dz * p;
    if (back) owed -= p * (v.z - 0.5 * dz * p);
    if (stop <= end) continue;
    if (back) {
      out.restitution = work;
      return out;
    }
    out.compression = work;
    owed = -e * e * work;
    work = 0.0;
    v.z = 0.0;
    back = true;
  }
  return out;
}

struct Strike {
  const char* name;
  double tilt, vx, vz, mu, e;
};
// slip goes on, ends in compression or restitution, is followed by rest or by slip the other way
const Strike kStrikes[] = {
    {"no friction", 0.3, 0.1, -0.2, 0.0, 0.6},
    {"no friction, e = 1", 0.2, 0.0, -0.3, 0.0, 1.0},
    {"slips throughout", 0.3, 0.5, -0.2, 0.2, 0.7},
    {"slips throughout, backwards", 0.3, -0.8, -0.2, 0.3, 0.5},
    {"rests from compression on", 0.3, -0.01, -0.2, 0.5, 0.8},
    {"rests from restitution on", 0.3, -0.09, -0.2, 0.4, 0.9},
    {"reverses in compression", 0.3, -0.03, -0.2, 0.1, 0.6},
    {"reverses in restitution", 0.3, -0.10, -0.2, 0.1, 0.9},
    {"from rest, rests", 0.25, 0.0, -0.1, 0.6, 0.3},
    {"from rest, slips", 0.3, 0.0, -0.1, 0.1, 1.0},
    {"e = 1 with friction", 0.15, 0.05, -0.25, 0.3, 1.0},
};

Scenario scenario(const Strike& c) {
  Scenario s = loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml",
                            {"contact.law=rigid", "gravity=0", "solver.tolerance=1e-13"});
  s.mechanism.coupling = CouplingParameters{};
  s.mechanism.carrier.stiffness.setZero();
  s.mechanism.friction = {c.mu, c.mu};
  s.contact.restitution = c.e;
  s.initial = InitialState{};
  s.initial.euler = {c.tilt, std::acos(0.0), 0.0};
  const double low =
      s.mechanism.peg.half_height * std::cos(c.tilt) + s.mechanism.peg.radius * std::sin(c.tilt);
  s.initial.position = Vector3d(0.08, 0.0, low + 1e-4);
  s.initial.velocity = Vector3d(c.vx, 0.0, c.vz);
  return s;
}

Bar barOf(const Scenario& s, double tilt) {
  const double h = s.mechanism.peg.half_height, r = s.mechanism.peg.radius;
  return {s.mechanism.peg.mass, s.mechanism.peg.inertia_transverse,
          r * std::cos(tilt) - h * std::sin(tilt), -h * std::cos(tilt) - r * std::sin(tilt)};
}

TEST(Restitution, BarStrikesThePlane) {
  for (const Strike& c : kStrikes) {
    const Scenario s = scenario(c);
    const Bar bar = barOf(s, c.tilt);
    const Outcome expected = strike(bar, {c.vx, c.vz}, c.mu, c.e);
    Simulation sim(s);
    // the gap of 0.1 mm takes at most 1 ms; nothing else happens in the next
    ASSERT_EQ(sim.advance(2e-3), StopReason::kOk) << c.name;
    ASSERT_EQ(sim.counts().impacts, 1) << c.name;
    const Vector9& v = sim.state().v;
    const Planar P = expected.impulse;
    // 1e-10: rounding of the gap at the impact, 1e-14 m over the gap's 1e-4 m
    const double tolerance = 1e-10 * std::abs(c.vz);
    EXPECT_NEAR(v(1), c.vx + P.x / s.mechanism.peg.mass, tolerance) << c.name;
    EXPECT_NEAR(v(0), c.vz + P.z / s.mechanism.peg.mass, tolerance) << c.name;
    EXPECT_NEAR(v(3), (bar.rz * P.x - bar.rx * P.z) / s.mechanism.peg.inertia_transverse,
                tolerance / s.mechanism.peg.radius)
        << c.name;
    EXPECT_NEAR(v(2), 0.0, tolerance) << c.name;
  }
}

// what Stronge's coefficient means: the normal force gives back e² of the work it took
TEST(Restitution, GivesBackTheSquareOfTheWork) {
  for (const Strike& c : kStrikes) {
    const Scenario s = scenario(c);
    const Bar bar = barOf(s, c.tilt);
    const Outcome o = strike(bar, {c.vx, c.vz}, c.mu, c.e);
    EXPECT_NEAR(o.restitution, -c.e * c.e * o.compression, 1e-14) << c.name;
    Simulation sim(s);
    const double before = sim.energy();
    sim.advance(2e-3);
    // and the rest of the energy is friction's: the kinetic energy changes by P · (v + v+)/2
    const Planar after = {c.vx + bar.xx() * o.impulse.x + bar.xz() * o.impulse.z,
                          c.vz + bar.xz() * o.impulse.x + bar.zz() * o.impulse.z};
    const double change = 0.5 * (o.impulse.x * (c.vx + after.x) + o.impulse.z * (c.vz + after.z));
    EXPECT_NEAR(sim.energy() - before, change, 1e-10 * before) << c.name;
    EXPECT_LE(change, 1e-15) << c.name;
  }
}

// the reference of other tests, in three dimensions and long double, has the same closed form
TEST(Restitution, ReferenceHasTheClosedForm) {
  using Real = long double;
  using Vec3 = Eigen::Matrix<Real, 3, 1>;
  for (const Strike& c : kStrikes) {
    const Bar b = barOf(scenario(c), c.tilt);
    const Outcome expected = strike(b, {c.vx, c.vz}, c.mu, c.e);
    Eigen::Matrix<Real, 3, 3> W = Eigen::Matrix<Real, 3, 3>::Zero();
    W(0, 0) = b.xx(), W(2, 2) = b.zz(), W(0, 2) = W(2, 0) = b.xz(), W(1, 1) = 1 / b.m;
    const auto got =
        reference::strongeImpact<Real>(W, Vec3(c.vx, 0, c.vz), Vec3::UnitZ(), c.mu, c.mu, c.e);
    EXPECT_NEAR(static_cast<double>(got.impulse(0)), expected.impulse.x, 1e-15) << c.name;
    EXPECT_NEAR(static_cast<double>(got.impulse(2)), expected.impulse.z, 1e-15) << c.name;
    EXPECT_NEAR(static_cast<double>(got.impulse(1)), 0.0, 1e-15) << c.name;
    EXPECT_NEAR(static_cast<double>(got.compression_work), expected.compression, 1e-15) << c.name;
  }
}

}  // namespace
}  // namespace assembly_cell
