// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the rigid law adds: impacts, and the projection of closed contacts.
#include <algorithm>
#include <cmath>

#include "assembly_cell/dynamics/simulation.h"
#include "contact_algebra.h"
#include "limits.h"
#include "stronge.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
constexpr int kPasses = 24;
constexpr double kSlipTolerance = 1e-12;  // post-impact slip below this has no direction [m/s]
constexpr int kTurns = 40, kStarts = 24;  // of the search for friction directions
constexpr double kTurn = 1e-7;            // to measure how an error changes [rad]
constexpr double kDirection = 1e-14, kSettled = 1e-9;  // aimed at; good enough [rad]
// slower approaches do not bounce: ends the accumulation of ever smaller bounces [m/s]
constexpr double kLeastBounce = 1e-3;
constexpr int kBounces = 60;      // impulses of one impact of several points, one after the other
constexpr int kStormPasses = 24;  // impacts of a step amid a storm
constexpr double kWedgeImpulse = 1e3;  // of the load: an impulse between two of them
constexpr double kOutside = 1e-9;      // of all impulses: beyond a cone
constexpr double kStormGap = 1e-12;    // penetration let be then [m]

}  // namespace

// impulses at points of the peg change its velocities
void Simulation::applyImpulse(const Vec3& impulse, const Vec3& moment) {
  state_.v += accelerationBy(impulse, moment);
  evaluateFree(time_, state_);
  locateAll();
}

// At least one closed point approaches. Points that bounce do so one after the other, the fastest
// first; what still approaches then, or too slowly to bounce, is stopped by one plastic impact of
// all closed points, or one after the other where friction leaves that without a solution.
void Simulation::impact() {
  const double before = kineticEnergy(scenario_, state_);
  if (scenario_.contact.restitution > 0.0) restitutionImpacts();
  plasticImpact(closed_);
  for (int n = 0; n < kBounces; ++n) {
    const std::size_t i = fastestApproach(kSettledSpeed);
    if (i == kSlots) break;
    plasticImpact(1u << i);
  }
  const double after = kineticEnergy(scenario_, state_);
  if (after > before) state_.v *= std::sqrt(before / after);
  // who leaves is apart at once
  for (std::size_t i = 0; i < kSlots; ++i) {
    if ((closed_ >> i & 1u) && valid(i) && touches_[i].gap_rate > 1e-9) setMode(i, Mode::kApart);
  }
}

// the closed slot that approaches fastest; kSlots where none is faster than `speed`
std::size_t Simulation::fastestApproach(double speed) const {
  std::size_t fastest = kSlots;
  double approach = -speed;
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u) || !valid(i) || touches_[i].gap_rate >= approach) continue;
    approach = touches_[i].gap_rate;
    fastest = i;
  }
  return fastest;
}

void Simulation::restitutionImpacts() {
  for (int n = 0; n < kBounces; ++n) {
    const std::size_t fastest = fastestApproach(kLeastBounce);
    if (fastest == kSlots) return;
    const Vec3 impulse = restitutionImpulse(fastest);
    applyImpulse(impulse, touches_[fastest].r.cross(impulse));
  }
}

// Of one point's impact with Stronge's energetic coefficient.
Vec3 Simulation::restitutionImpulse(std::size_t i) const {
  const Touch& touch = touches_[i];
  const Body body = this->body();
  Mat3 W;
  for (int axis = 0; axis < 3; ++axis) {
    W.col(axis) = response(body, touch.r, touch.r, Vec3::Unit(axis));
  }
  return strongeImpulse(W, point(i).normal, touch.velocity, scenario_.friction,
                        scenario_.contact.restitution);
}

// No point approaches afterwards, impulses only push, Coulomb's law with the sliding coefficient on
// the slip after the impact. Points are tried as sticking first; the worst offender changes until
// none is left. Dynamics specification section 4C.
void Simulation::plasticImpact(ContactSlotMask points) {
  const Body body = this->body();
  enum class Kind { kNone, kStick, kSlip };
  std::array<Kind, kSlots> kind{};
  std::array<Vec3, kSlots> friction{}, impulse{};
  for (std::size_t i = 0; i < kSlots; ++i) {
    kind[i] = (points >> i & 1u) && valid(i) ? Kind::kStick : Kind::kNone;
    friction[i].setZero();
    impulse[i].setZero();
  }
  const double mu = scenario_.friction.sliding_coefficient;
  const auto velocityAfter = [&](std::size_t i) {
    Vec3 v = touches_[i].velocity;
    for (std::size_t j = 0; j < kSlots; ++j) {
      if (kind[j] != Kind::kNone) v += response(body, touches_[i].r, touches_[j].r, impulse[j]);
    }
    return v;
  };

  // impulses for these kinds and friction directions; false: no point is left
  const auto solve = [&] {
    std::array<Constraint, kSlots> constraints;
    std::array<std::size_t, kSlots> slot_of{};
    std::size_t n = 0, sticks = 0;
    for (std::size_t i = 0; i < kSlots; ++i) {
      impulse[i].setZero();
      if (kind[i] == Kind::kNone) continue;
      Constraint& row = constraints[n];
      slot_of[n++] = i;
      row.stick = kind[i] == Kind::kStick;
      sticks += row.stick ? 1 : 0;
      row.r = touches_[i].r;
      row.normal = point(i).normal;
      row.direction = row.normal + mu * friction[i];
      row.change = -touches_[i].velocity;
    }
    if (n == 0) return false;
    solveConstraints(body, constraints.data(), static_cast<int>(n));
    for (std::size_t j = 0; j < n; ++j) {
      impulse[slot_of[j]] = constraints[j].force;
      touches_[slot_of[j]].force = constraints[j].force;
      touches_[slot_of[j]].normal_force = constraints[j].normal.dot(constraints[j].force);
    }
    if (sticks == 2) {
      ContactSlotMask resting = 0;
      for (std::size_t j = 0; j < n; ++j) {
        if (constraints[j].stick) resting |= 1u << slot_of[j];
      }
      shareInternalForces(resting, kLoads);
      for (std::size_t j = 0; j < n; ++j) impulse[slot_of[j]] = touches_[slot_of[j]].force;
    }
    return true;
  };

  // Friction opposes the slip after the impact: angles in the contact planes by Newton, from the
  // present directions, from the slip before the impact, and for one point from all round.
  std::array<std::size_t, kSlots> slipping{};
  std::size_t slips = 0;
  using Angles = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1>;
  const auto turn = [&](std::size_t i, double angle) {
    const Vec3& f = friction[i];
    friction[i] = (std::cos(angle) * f + std::sin(angle) * point(i).normal.cross(f)).normalized();
  };
  const auto errors = [&] {
    solve();
    Angles e(static_cast<Eigen::Index>(slips));
    for (std::size_t j = 0; j < slips; ++j) {
      const Vec3& normal = point(slipping[j]).normal;
      Vec3 slip = velocityAfter(slipping[j]);
      slip -= normal * normal.dot(slip);
      const Vec3& f = friction[slipping[j]];
      e(static_cast<Eigen::Index>(j)) =
          slip.norm() > kSlipTolerance ? std::atan2(-normal.dot(f.cross(slip)), -f.dot(slip)) : 0.0;
    }
    return e;
  };
  const auto converge = [&] {
    Angles e = errors();
    for (int step = 0; step < kTurns && e.cwiseAbs().maxCoeff() > kDirection; ++step) {
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kSlots> slope(e.size(),
                                                                                     e.size());
      const auto from = friction;
      for (std::size_t j = 0; j < slips; ++j) {
        turn(slipping[j], kTurn);
        slope.col(static_cast<Eigen::Index>(j)) = (errors() - e) / kTurn;
        friction = from;
      }
      const Angles full = -slope.partialPivLu().solve(e);
      // shortened until the errors shrink
      bool better = false;
      for (double part = std::min(1.0, 1.0 / full.cwiseAbs().maxCoeff()); part > 1e-3; part /= 2) {
        for (std::size_t j = 0; j < slips; ++j) {
          turn(slipping[j], part * full(static_cast<Eigen::Index>(j)));
        }
        const Angles next = errors();
        if (next.norm() < e.norm()) {
          e = next;
          better = true;
          break;
        }
        friction = from;
      }
      if (!better) break;
    }
    return e.cwiseAbs().maxCoeff();
  };
  const auto settleDirections = [&] {
    const auto start = friction;
    double least = converge();
    auto best = friction;
    const auto attempt = [&] {
      const double error = converge();
      if (error < least) {
        least = error;
        best = friction;
      }
    };
    if (least > kSettled) {
      for (std::size_t j = 0; j < slips; ++j) {
        const Vec3& before = touches_[slipping[j]].tangential;
        if (before.norm() > kSlipTolerance) friction[slipping[j]] = -before.normalized();
      }
      attempt();
    }
    for (int k = 1; least > kSettled && slips == 1 && k < kStarts; ++k) {
      friction = start;
      turn(slipping[0], k * 6.283185307179586 / kStarts);
      attempt();
    }
    friction = best;
    solve();
  };

  for (int pass = 0; pass < kPasses; ++pass) {
    slips = 0;
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (kind[i] == Kind::kSlip) slipping[slips++] = i;
    }
    if (!solve()) break;
    if (slips > 0 && mu > 0.0) settleDirections();

    // pulled, beyond the cone, or left out but approaching
    std::size_t worst = kSlots;
    double total = 0.0;
    for (std::size_t i = 0; i < kSlots; ++i) total += impulse[i].norm();
    double excess = 1e-12 * total;
    std::size_t offender = kSlots;  // beyond the cone
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (kind[i] == Kind::kNone) continue;
      const double N = point(i).normal.dot(impulse[i]);
      if (N < -excess) {
        excess = -N;
        worst = i;
      }
    }
    for (std::size_t i = 0; worst == kSlots && i < kSlots; ++i) {
      if (kind[i] != Kind::kStick) continue;
      const double N = point(i).normal.dot(impulse[i]);
      const Vec3 tangential = impulse[i] - N * point(i).normal;
      const double size = tangential.norm();
      if (size - mu * N > std::max(excess, 1e-12 * size)) {
        excess = size - mu * N;
        offender = i;
        friction[i] = tangential / size;
      }
    }
    if (offender < kSlots) {
      kind[offender] = Kind::kSlip;
      continue;
    }
    if (worst < kSlots) {
      // to stop the slip may ask for a pull: it goes on
      const Vec3& slip = touches_[worst].tangential;
      const bool goes_on = kind[worst] == Kind::kStick && slip.norm() > kSlipTolerance && mu > 0.0;
      kind[worst] = goes_on ? Kind::kSlip : Kind::kNone;
      if (goes_on) friction[worst] = -slip.normalized();
      continue;
    }
    bool rejoined = false;
    for (std::size_t i = 0; i < kSlots && pass < kPasses / 2; ++i) {
      if (kind[i] != Kind::kNone || !(points >> i & 1u) || !valid(i)) continue;
      if (point(i).normal.dot(velocityAfter(i)) < -1e-12) {
        kind[i] = Kind::kStick;
        rejoined = true;
      }
    }
    if (!rejoined) break;
  }

  Vec3 total = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (kind[i] == Kind::kNone) continue;
    total += impulse[i];
    moment += touches_[i].r.cross(impulse[i]);
  }
  applyImpulse(total, moment);
  for (std::size_t i = 0; i < kSlots; ++i) touches_[i].force = impulse[i];
}

// Impact without collision: friction wedges slipping points the faster the harder they press
// (Painlevé's paradox, two points against each other) and force grows without bound within finite
// time, or no force agrees with their slip at all. Points come to rest at once: of all sets that
// impulses within the cones of friction bring to rest without another point approaching, the one
// that loses most energy; all points where there is none, or where it wasn't enough (`everything`).
void Simulation::jam(bool everything) {
  ++counts_.jams;
  ContactSlotMask all = 0;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (valid(i)) all |= 1u << i;
  }
  const Body body = this->body();
  // energy lost by the impulses that bring these points to rest; left in touches_
  const auto stop = [&](ContactSlotMask points) {
    std::array<Constraint, kSlots> rows;
    std::size_t n = 0;
    for (ContactSlotMask left = points; left; left &= left - 1) {
      const auto i = static_cast<std::size_t>(__builtin_ctz(left));
      rows[n].stick = true;
      rows[n].r = touches_[i].r;
      rows[n].normal = rows[n].direction = point(i).normal;
      rows[n++].change = -touches_[i].velocity;
    }
    solveConstraints(body, rows.data(), static_cast<int>(n));
    double loss = 0.0;
    n = 0;
    for (ContactSlotMask left = points; left; left &= left - 1) {
      Touch& touch = touches_[static_cast<std::size_t>(__builtin_ctz(left))];
      touch.force = rows[n].force;
      touch.normal_force = rows[n].normal.dot(touch.force);
      loss += 0.5 * rows[n].force.dot(rows[n].change);
      ++n;
    }
    return loss;
  };
  ContactSlotMask best = all;
  double most = 0.0;
  for (ContactSlotMask points = everything ? 0 : all; points; points = (points - 1) & all) {
    const double loss = stop(points);
    if (loss <= most || !restInCones(points, all & ~points)) continue;
    most = loss;
    best = points;
  }
  stop(best);
  Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
  for (ContactSlotMask left = best; left; left &= left - 1) {
    const Touch& touch = touches_[static_cast<std::size_t>(__builtin_ctz(left))];
    impulse += touch.force;
    moment += touch.r.cross(touch.force);
  }
  const double before = kineticEnergy(scenario_, state_);
  applyImpulse(impulse, moment);
  const double after = kineticEnergy(scenario_, state_);
  if (after > before) state_.v *= std::sqrt(before / after);
}

// The impulses that bring these points to rest lie within their cones, with as much between any two
// of them as it takes, and let none of the others approach faster.
bool Simulation::restInCones(ContactSlotMask points, ContactSlotMask others) {
  const Body body = this->body();
  for (ContactSlotMask left = others; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    double change = 0.0;
    for (ContactSlotMask from = points; from; from &= from - 1) {
      const Touch& touch = touches_[static_cast<std::size_t>(__builtin_ctz(from))];
      change += point(i).normal.dot(response(body, touches_[i].r, touch.r, touch.force));
    }
    if (std::max(change, touches_[i].gap_rate + change) < -kSettledSpeed) return false;
  }
  double size = 0.0;
  for (ContactSlotMask left = points; left; left &= left - 1) {
    size += touches_[static_cast<std::size_t>(__builtin_ctz(left))].force.norm();
  }
  if (!inCones(points, kOutside * size)) shareInternalForces(points, kWedgeImpulse);
  return inCones(points, kOutside * size);
}

// Closed contacts stay closed: gaps, gap rates and the slip of resting points are put to zero by
// the smallest correction in the metric of the kinetic energy. Frictionless rows throughout.
void Simulation::project() {
  std::array<Constraint, kSlots> velocity, position;
  std::size_t n = 0;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (slots_[i].mode == Mode::kIdle || !valid(i)) continue;
    Constraint& row = velocity[n];
    row.stick = slots_[i].mode == Mode::kStick;
    row.r = touches_[i].r;
    row.normal = row.direction = point(i).normal;
    row.change = -(row.stick ? touches_[i].velocity : Vec3(touches_[i].gap_rate * row.normal));
    position[n] = row;
    position[n].stick = false;
    position[n].change = -touches_[i].gap * row.normal;
    ++n;
  }
  if (n == 0) return;
  Body body = this->body();
  solveConstraints(body, velocity.data(), static_cast<int>(n));
  solveConstraints(body, position.data(), static_cast<int>(n));
  Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero(), lift = Vec3::Zero(), turn = Vec3::Zero();
  for (std::size_t j = 0; j < n; ++j) {
    impulse += velocity[j].force;
    moment += velocity[j].r.cross(velocity[j].force);
    lift += position[j].force;
    turn += position[j].r.cross(position[j].force);
  }
  state_.v += accelerationBy(impulse, moment);
  state_.q += accelerationBy(lift, turn);
}

// takes from all speeds alike what the present energy is above `most`
void Simulation::limitEnergy(double most) {
  const double excess = energy() - most;
  if (!(excess > 0.0)) return;
  state_.v *= std::sqrt(std::max(0.0, 1.0 - excess / kineticEnergy(scenario_, state_)));
}

// A step amid a storm of events, to time t: an impact that lets no point be closer than zero at the
// end, again and again (a flat peg that is stopped on one side comes down on the other), then free
// flight. Of first order at contacts; a peg at rest hops by nanometres. Never gives energy.
void Simulation::stormStep(double t) {
  const double h = t - time_, before = energy();
  const State start = state_;
  evaluateFree(time_, state_);
  const Vector9 fall = 0.5 * h * now_.free;
  std::array<Vec3, kSlots> impulse;
  impulse.fill(Vec3::Zero());
  state_.v += fall;
  for (Slot& slot : slots_) slot.depth = 0.0;
  for (int pass = 0; pass < kStormPasses; ++pass) {
    // of the step: mean velocity, place at the end
    state_.q = start.q + h * state_.v;
    for (std::size_t i = 0; i < kSlots; ++i) setMode(i, Mode::kApart);
    evaluateFree(t, state_);
    locateAll();
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (!(admitted_ >> i & 1u) || !valid(i) || point(i).gap > -kStormGap) continue;
      setMode(i, Mode::kIdle);
      touches_[i].velocity += (point(i).gap / h - touches_[i].gap_rate) * point(i).normal;
    }
    if (!closed_) break;
    plasticImpact(closed_);
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (closed_ >> i & 1u) impulse[i] += touches_[i].force;
    }
  }
  for (std::size_t i = 0; i < kSlots; ++i) setMode(i, Mode::kApart);
  state_ = {start.q, state_.v - fall};
  limitEnergy(before);
  evaluateFree(time_, state_);
  slope_v_ = now_.free;
  State end;
  Vector9 slope;
  tryOneStep(Method::kRk4, h, end, slope);
  time_ = t;
  state_ = end;
  ++counts_.steps;
  if (time_ >= coarse_until_) {
    const double most = energy();
    findModes(false);
    if (energy() > most) {
      limitEnergy(most);
      decide();
    }
    return;
  }
  // mean forces of the step
  evaluateFree(time_, state_);
  locateAll();
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(admitted_ >> i & 1u) || !valid(i) || impulse[i].isZero()) continue;
    Touch& touch = touches_[i];
    touch.force = impulse[i] / h;
    touch.normal_force = point(i).normal.dot(touch.force);
    const Vec3 friction = touch.force - touch.normal_force * point(i).normal;
    const bool slips =
        friction.norm() > 0.999 * scenario_.friction.sliding_coefficient * touch.normal_force;
    setMode(i, slips ? Mode::kSlip : Mode::kStick);
  }
}

}  // namespace assembly_cell
