// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "rest_forces.h"

#include <algorithm>

#include "contact_solver.h"
#include "mode_search.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Efforts are those of 60 pegs pushed into the corner of floor and wall.

// Fractions of the friction coefficient of the cones that are tried in turn: forces well inside
// stay inside when loads change. The last three alone: +68 %, the last one alone: +108 %.
constexpr std::array<double, 4> kNarrower = {0.5, 0.9, 0.99, 0.999};
// Maximum number of sweeps over all points, and over-relaxation (1: 2 % more; 1.9: 1 %). Half and
// twice of the first: 6 % more and 3 % less.
constexpr int kSweeps = 200;
constexpr double kBeyond = 1.7;
// A cone is abandoned if this number of sweeps leaves more than this fraction of the squared
// residual: 7 % less than all sweeps, with 4 % more steps.
constexpr int kCheckInterval = 20;
constexpr double kSlow = 0.9;
// Tolerance of the residual over the acceleration by the forces, below the smallest margin. Half
// and twice: 6 % and 1 % more.
constexpr double kHeld = 1e-4;

// Projection of a force onto a friction cone.
Vec3 projected(const Vec3& force, const Vec3& normal, double mu) {
  const double N = normal.dot(force);
  const Vec3 tangential = force - N * normal;
  const double T = tangential.norm();
  if (T <= mu * N) return force;
  const double n = (N + mu * T) / (1.0 + mu * mu);
  if (!(n > 0.0)) return Vec3::Zero();
  return n * normal + mu * n / T * tangential;
}

// Forces inside the cones of coefficient mu with the resultant acceleration of `target`, by
// projected Gauss-Seidel iteration from the given ones. False without convergence.
bool findInside(const Body& body, const ForceMoment& target, double mu, const Evaluation& e,
                std::array<Vec3, kSlots>& forces) {
  const ContactSlotMask points = e.active();
  const double turning = 1.0 / std::min(body.inertia_transverse, body.inertia_axial);
  const Vec3 asked = target.force / body.mass, turn = body.inverse_inertia * target.moment;
  ForceMoment sum;
  double scale = 0.0, before = HUGE_VAL;
  for (const std::size_t i : Slots(points)) {
    sum.add(e.contacts[i].r, forces[i]);
    scale = std::max(scale, (asked + turn.cross(e.contacts[i].r)).squaredNorm());
  }
  // residual of the acceleration
  Vec3 linear = sum.force / body.mass - asked, angular = body.inverse_inertia * sum.moment - turn;
  for (int sweep = 1; sweep <= kSweeps; ++sweep) {
    double maximum = 0.0;
    for (const std::size_t i : Slots(points)) {
      const Vec3& r = e.contacts[i].r;
      const Vec3 off = linear + angular.cross(r);
      const double compliance = 1.0 / body.mass + turning * r.squaredNorm();
      const Vec3 next = projected(forces[i] - kBeyond / compliance * off, e.point(i).normal, mu);
      const Vec3 change = next - forces[i];
      forces[i] = next;
      linear += change / body.mass;
      angular += body.inverse_inertia * r.cross(change);
      maximum = std::max(maximum, off.squaredNorm());
    }
    if (maximum < kHeld * kHeld * scale) return true;
    if (sweep % kCheckInterval > 0) continue;
    if (maximum > kSlow * before) return false;
    before = maximum;
  }
  return false;
}

}  // namespace

bool findAdmissibleRestForces(const System& s, double limit, Context& c, Evaluation& e) {
  const ContactSlotMask points = e.active();
  if (__builtin_popcount(points) < 3 || !(points & ~e.face)) return false;
  ForceMoment target;
  std::array<Vec3, kSlots> forces;
  double load = 0.0;
  for (const std::size_t i : Slots(points)) {
    if (c.slots[i].mode != Mode::kStick) return false;
    forces[i] = e.contacts[i].force;
    target.add(e.contacts[i].r, forces[i]);
    load += forces[i].norm();
  }
  const double allowed = limit * s.scenario.mechanism.peg.mass;
  if (worstViolation(s, c, e) <= allowed) return false;
  const Body body = bodyOf(s, e.k);
  const double mu = s.scenario.mechanism.friction.static_coefficient;
  // each cone starts from the result of the narrower one
  const bool held = std::any_of(kNarrower.begin(), kNarrower.end(), [&](double part) {
    return findInside(body, target, part * mu, e, forces);
  });
  double total = 0.0;
  for (const std::size_t i : Slots(points)) total += forces[i].norm();
  if (!held || total > (1.0 + e.loads) * load) return false;
  for (const std::size_t i : Slots(points)) c.slots[i].rest_force = forces[i];
  c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
  if (worstViolation(s, c, e) <= allowed) return true;
  for (const std::size_t i : Slots(points)) c.slots[i].rest_force.setZero();
  c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
  return false;
}

}  // namespace assembly_cell
