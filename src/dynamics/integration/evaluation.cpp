// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "evaluation.h"

#include <Eigen/LU>
#include <algorithm>

#include "contact/contact_solver.h"
#include "face/face_points.h"

namespace assembly_cell {
namespace {

// Maximum penetration over the radius: deeper candidates are on the other side of the peg. Half and
// twice: 7 and 2 of 400 random scenes end elsewhere.
constexpr double kDeepest = 0.1;
// Edge speed within a step over that at its ends, for the bound with which searches are skipped.
// Half and twice: 10 and 2 of 400 random scenes end elsewhere, by less than 1 um.
constexpr double kSpare = 1.5;
// Maximum extrapolation of a contact point along its circle as the start of a search [rad].
constexpr double kFarthest = 0.01;

}  // namespace

void evaluateFree(const System& s, const Commands& commands, double t, const State& state,
                  Evaluation& e) {
  ++e.count;
  kinematics(state, e.near, e.k);
  e.euler_rates = state.v.segment<3>(3);
  if (t != e.drive_time) {
    e.drive_time = t;
    // by elements, as in model.cpp
    const Eigen::Vector2d force = exciterForce(commands.drive, t, e.drive_near);
    e.drive_force(0) = force(0);
    e.drive_force(1) = force(1);
  }
  if (commands.shift || !commands.settledAt(t)) {
    freeMotion(s.scenario, e.k, state, commands.restAt(t), e.drive_force, e.motion);
  } else {
    freeMotion(s.scenario, e.k, state, commands.settled, e.drive_force, e.motion);
  }
  solveMass(s.inverse_mass, e.k, e.motion.force, e.free);
}

void locate(const System& s, const Context& c, ContactSlotMask mask, Evaluation& e,
            ContactSet& set) {
  // positions of closed slots are excluded for open ones
  for (const std::size_t i : Slots(kPairSlots & s.admitted & ~mask)) {
    set.slots[i].valid = false;
    if (&set == &e.open_set && (e.active() >> i & 1u)) set.slots[i] = e.closed_set.slots[i];
  }
  e.face = facePoints(c.face);
  findContacts(e.edge, s.shapes, mask & ~e.face, set);
  if (c.face.on) locateFace(s, c.face, e.edge, mask, set);
  ContactSlotMask found = set.valid & mask;
  for (const std::size_t i : Slots(found)) {
    const ContactPoint& point = set.slots[i];
    if (point.gap < -kDeepest * s.scenario.mechanism.peg.radius) {
      found &= ~(1u << i);
      continue;
    }
    ContactKinematics& at = e.contacts[i];
    at.gap = point.gap - c.slots[i].depth;
    at.r = point.p - e.k.x;
    at.velocity = e.k.v + e.k.omega.cross(at.r);
    at.gap_rate = point.normal.dot(at.velocity);
    at.tangential = at.velocity - at.gap_rate * point.normal;
  }
  set.valid = (set.valid & ~mask) | found;
}

void locateAll(const System& s, const Context& c, Evaluation& e) {
  e.edge = s.edge(e.k);
  if (e.closed) locate(s, c, e.closed, e, e.closed_set);
  const ContactSlotMask open = s.admitted & ~e.closed;
  if (open) locate(s, c, open, e, e.open_set);
}

void evaluatePresent(const System& s, const Context& c, Evaluation& e) {
  evaluateFree(s, c.commands, c.time, c.state, e);
  locateAll(s, c, e);
}

Vector9 evaluate(const System& s, const Context& c, double t, const State& state, Level level,
                 Evaluation& e) {
  const double since = t - e.drive_time;
  evaluateFree(s, c.commands, t, state, e);
  if (!s.admitted || (level == Level::kForces && !e.closed)) return e.free;

  // closed contacts, and at a step's end the others, unless the path of the edge since the last
  // search is below the clearance
  const ContactSlotMask open = e.watched ? s.admitted & ~e.closed : 0u;
  bool search = false;
  if (level != Level::kForces && open) {
    e.speed = edgeSpeed(s, e.k);
    e.moved = kSpare * (t - c.time) * std::max(c.edge_speed, e.speed);
    search = e.moved >= c.clearance || c.face.on;
    if (!search) e.open_set.valid = 0;
  }
  e.clear = !search && !e.closed;
  if (e.clear) return e.free;
  e.edge = s.edge(e.k);
  for (const std::size_t i : Slots(e.active())) {
    const double by = since * e.contacts[i].rates.run;
    if (std::abs(by) < kFarthest) turnPlace(by, e.closed_set.slots[i]);
  }
  if (e.closed) locate(s, c, e.closed, e, e.closed_set);
  if (search) locate(s, c, open, e, e.open_set);
  return e.closed ? contactForces(s, c.slots, level, e) : e.free;
}

double edgeSpeed(const System& s, const Kinematics& k) {
  return std::sqrt(2.0 * (k.v.squaredNorm() + s.arm * s.arm * k.omega.squaredNorm()));
}

double freeAcceleration(const System& s, const Evaluation& e) {
  return e.free.head<3>().norm() + s.arm * e.free.segment<3>(3).norm();
}

Body bodyOf(const System& s, const Kinematics& k) {
  Body b;
  const PegParameters& peg = s.scenario.mechanism.peg;
  b.mass = peg.mass;
  b.inertia_transverse = peg.inertia_transverse;
  b.inertia_axial = peg.inertia_axial;
  b.axis = k.a;
  const double it = 1.0 / peg.inertia_transverse, ia = 1.0 / peg.inertia_axial - it;
  b.inverse_inertia = ia * k.a * k.a.transpose();
  b.inverse_inertia.diagonal().array() += it;
  if (s.scenario.thesis.moments) {
    // thesis_moments: generalised moment of a contact force by Re^-1 instead of the transpose
    b.symmetric = false;
    b.inverse_inertia *= (k.Re * k.Re.transpose()).inverse();
  }
  return b;
}

Vector9 accelerationBy(const System& s, const Kinematics& k, const ForceMoment& by) {
  Vector9 generalised = Vector9::Zero();
  generalised.head<3>() = by.force;
  generalised.segment<3>(3) = s.scenario.thesis.moments
                                  ? Eigen::Vector3d(k.Re.inverse() * by.moment)
                                  : Eigen::Vector3d(k.Re.transpose() * by.moment);
  Vector9 rate;
  solveMass(s.inverse_mass, k, generalised, rate);
  return rate;
}

}  // namespace assembly_cell
