// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "impact.h"

#include <algorithm>
#include <cmath>

#include "contact/contact_modes.h"
#include "contact/contact_solver.h"
#include "contact/contact_tolerances.h"
#include "integration/integrator.h"
#include "stronge.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
// Approach speed below which restitution is zero, to end series of bounces; such a rebound rises by
// 50 nm. Half and twice: 23 of 400 random scenes, those with restitution, end elsewhere.
constexpr double kMinBounce = 1e-3;  // [m/s]
constexpr int kBounces = 60;         // maximum number of sequential impulses of one impact
// Limit of internal impulses of two sticking points over their load, far above the need of a cone
// at μ = 0.001; and tolerance of cone excess over the sum of impulses, whose rounding is 1e-15. No
// result changes at half or twice of either.
constexpr double kWedgeImpulse = 1e3;
constexpr double kOutside = 1e-9;
// Correction by project() over the tolerance above which the evaluation is outdated. Half and
// twice: a vibrated run takes the same effort.
constexpr double kPutRight = 0.1;

// Active contact with the highest approach speed; kSlots if none exceeds `speed` [m/s].
std::size_t fastestApproach(const Evaluation& e, double speed) {
  std::size_t fastest = kSlots;
  double approach = -speed;
  for (const std::size_t i : Slots(e.active())) {
    if (e.contacts[i].gap_rate >= approach) continue;
    approach = e.contacts[i].gap_rate;
    fastest = i;
  }
  return fastest;
}

// Impulse of one point with energetic restitution [N s].
Vec3 restitutionImpulse(const System& s, const Evaluation& e, std::size_t i) {
  const ContactKinematics& at = e.contacts[i];
  const Body body = bodyOf(s, e.k);
  Eigen::Matrix3d W;
  for (int axis = 0; axis < 3; ++axis) {
    W.col(axis) = response(body, at.r, at.r, Vec3::Unit(axis));
  }
  return strongeImpulse(W, e.point(i).normal, at.velocity, s.scenario.mechanism.friction,
                        s.scenario.contact.restitution);
}

Kinematics kinematicsOf(const Context& c, const Evaluation& e) {
  Kinematics k;
  kinematics(c.state, e.near, k);
  return k;
}

double kineticEnergyOf(const System& s, const Context& c, const Evaluation& e) {
  return kineticEnergy(s.scenario, kinematicsOf(c, e), c.state.v);
}

// Removes an increase of kinetic energy by rounding.
void limitKineticEnergy(const System& s, double before, Context& c, const Evaluation& e) {
  const double after = kineticEnergyOf(s, c, e);
  if (after > before) c.state.v *= std::sqrt(before / after);
}

// Impulses that bring these points to rest, stored as forces in e; `loss`: dissipated energy [J].
ForceMoment stoppingImpulse(const System& s, ContactSlotMask points, Evaluation& e, double& loss) {
  Constraints rows;
  for (const std::size_t i : Slots(points)) {
    Constraint& row = rows.add(i, e.contacts[i].r, e.point(i).normal);
    row.stick = true;
    row.change = -e.contacts[i].velocity;
  }
  solveConstraints(bodyOf(s, e.k), rows);
  loss = 0.0;
  for (const Constraint& row : rows) {
    ContactKinematics& at = e.contacts[row.slot];
    at.force = row.force;
    at.normal_force = row.normal.dot(at.force);
    loss += 0.5 * row.force.dot(row.change);
  }
  return rows.total();
}

// The impulses that stop these points are within their friction cones, with suitable internal
// impulses, and don't accelerate an approach of the others.
bool restInCones(const System& s, ContactSlotMask points, ContactSlotMask others, Evaluation& e) {
  const Body body = bodyOf(s, e.k);
  for (const std::size_t i : Slots(others)) {
    double change = 0.0;
    for (const std::size_t j : Slots(points)) {
      const ContactKinematics& from = e.contacts[j];
      change += e.point(i).normal.dot(response(body, e.contacts[i].r, from.r, from.force));
    }
    if (std::max(change, e.contacts[i].gap_rate + change) < -kSettledSpeed) return false;
  }
  double size = 0.0;
  for (const std::size_t i : Slots(points)) size += e.contacts[i].force.norm();
  if (!insideCones(s, e, points, kOutside * size)) {
    shareInternalForces(s, points, kWedgeImpulse, e);
  }
  return insideCones(s, e, points, kOutside * size);
}

}  // namespace

void applyImpulse(const System& s, const ForceMoment& impulse, Context& c, Evaluation& e) {
  c.state.v += accelerationBy(s, e.k, impulse);
  evaluatePresent(s, c, e);
}

void impact(const System& s, Context& c, Evaluation& e) {
  const double before = kineticEnergyOf(s, c, e);
  for (int n = 0; s.scenario.contact.restitution > 0.0 && n < kBounces; ++n) {
    const std::size_t i = fastestApproach(e, kMinBounce);
    if (i == kSlots) break;
    ForceMoment impulse;
    impulse.add(e.contacts[i].r, restitutionImpulse(s, e, i));
    applyImpulse(s, impulse, c, e);
  }
  plasticImpact(s, e.closed, c, e);
  for (int n = 0; n < kBounces; ++n) {
    const std::size_t i = fastestApproach(e, kSettledSpeed);
    if (i == kSlots) break;
    plasticImpact(s, 1u << i, c, e);
  }
  limitKineticEnergy(s, before, c, e);
  // points that separate open at once
  for (const std::size_t i : Slots(e.active())) {
    if (e.contacts[i].gap_rate > 1e-9) setMode(i, Mode::kApart, c, e);
  }
}

void painleveImpact(const System& s, bool everything, Context& c, Evaluation& e) {
  ++c.counts.painleve_impacts;
  const ContactSlotMask all = e.active();
  ContactSlotMask best = all;
  double largest = 0.0, loss = 0.0;
  for (ContactSlotMask points = everything ? 0 : all; points; points = (points - 1) & all) {
    stoppingImpulse(s, points, e, loss);
    if (loss <= largest || !restInCones(s, points, all & ~points, e)) continue;
    largest = loss;
    best = points;
  }
  const double before = kineticEnergyOf(s, c, e);
  applyImpulse(s, stoppingImpulse(s, best, e, loss), c, e);
  limitKineticEnergy(s, before, c, e);
}

bool project(const System& s, Context& c, const Evaluation& e) {
  Constraints velocity, position;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode == Mode::kIdle) continue;
    const ContactKinematics& at = e.contacts[i];
    const Vec3& normal = e.point(i).normal;
    Constraint& row = velocity.add(i, at.r, normal);
    row.stick = c.slots[i].mode == Mode::kStick;
    row.change = -(row.stick ? at.velocity : Vec3(at.gap_rate * normal));
    position.add(i, at.r, normal).change = -at.gap * normal;
  }
  if (velocity.n == 0) return false;
  const Body body = bodyOf(s, e.k);
  solveConstraints(body, velocity);
  solveConstraints(body, position);
  const Vector9 dv = accelerationBy(s, e.k, velocity.total());
  const Vector9 dq = accelerationBy(s, e.k, position.total());
  c.state.v += dv;
  c.state.q += dq;
  return errorOf(s, State{dq, dv, Vec3::Zero()}) > kPutRight;
}

double energyOf(const System& s, const Context& c, const Evaluation& e) {
  return mechanicalEnergy(s.scenario, kinematicsOf(c, e), c.state, c.commands.restAt(c.time));
}

void limitEnergy(const System& s, double limit, Context& c, const Evaluation& e) {
  const double excess = energyOf(s, c, e) - limit;
  if (!(excess > 0.0)) return;
  c.state.v *= std::sqrt(std::max(0.0, 1.0 - excess / kineticEnergyOf(s, c, e)));
}

}  // namespace assembly_cell
