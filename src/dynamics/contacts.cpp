// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contact points of an evaluation, their forces, and who carries, slips and rests.
#include <algorithm>
#include <cmath>

#include "assembly_cell/dynamics/simulation.h"
#include "contact_algebra.h"
#include "limits.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;

constexpr double kDeepest = 0.1;  // penetration beyond this part of the radius is no contact
constexpr double kFlat = 1e-5;    // below this tilt the lowest point has no speed [rad]
constexpr double kSpare = 1.5;    // edge speed inside a step over that at its ends
// of the typical force, at a tolerance of 1e-9 m and above: changes below it change no mode
constexpr double kHysteresis = 1e-8;
constexpr int kPasses = 24, kTurns = 100;
constexpr double kRest = 1.5;   // slip below this many times its threshold may be rest
constexpr int kShares = 2;      // rounds of sharing among more than two resting points
constexpr double kAhead = 0.9;  // slip goes against its friction: cosine

double slipFriction(bool slides, double speed, const ContactParameters& c,
                    const FrictionParameters& f) {
  return slides ? f.sliding_coefficient : f.static_coefficient * speed / c.regularisation_speed;
}

}  // namespace

bool Simulation::discreteFriction() const {
  return rigid() ||
         (scenario_.contact.law == ContactLaw::kViscous && scenario_.contact.stationary_rows);
}

// a contact opens above this: without states of rest its force ends at zero gap
double Simulation::leaveGap() const { return discreteFriction() ? kReach : kTouch; }

void Simulation::setMode(std::size_t i, Mode mode) {
  const ContactSlotMask bit = 1u << i;
  const bool was = (closed_ & bit) != 0, is = mode != Mode::kApart;
  slots_[i].mode = mode;
  if (was == is) return;
  // the point moves to the set it is searched with
  const ContactSet& from = was ? closed_set_ : open_set_;
  ContactSet& to = was ? open_set_ : closed_set_;
  to.slots[i] = from.slots[i];
  to.valid = (to.valid & ~bit) | (from.valid & bit);
  closed_ ^= bit;
}

// a contact that just closed deeper than it can have come; `handed`: gap of the one it takes over
void Simulation::keepDepth(std::size_t i, double handed) {
  const double deeper = touches_[i].gap - handed;
  if (deeper >= -kFound) return;
  slots_[i].depth += deeper;
  touches_[i].gap = handed;
}

void Simulation::healDepths() {
  for (std::size_t i = 0; i < kSlots; ++i) {
    double& depth = slots_[i].depth;
    if (depth < 0.0) depth = valid(i) ? std::min(0.0, std::max(depth, point(i).gap)) : 0.0;
  }
}

void Simulation::evaluateFree(double t, const State& state) {
  ++counts_.evaluations;
  kinematics(state, near_, now_.k);
  now_.rates = state.v.segment<3>(3);
  if (t != drive_time_) {
    drive_time_ = t;
    drive_force_ = exciterForce(drive_, t);
  }
  if (t < profile_.start + profile_.duration) {
    freeMotion(scenario_, now_.k, state, restAt(t), drive_force_, now_.motion);
  } else {
    freeMotion(scenario_, now_.k, state, settled_, drive_force_, now_.motion);
  }
  now_.free = solveMass(scenario_, now_.k, now_.motion.force);
}

void Simulation::locate(ContactSlotMask mask, ContactSet& set) {
  // places that closed slots hold are not for open ones
  for (ContactSlotMask left = (kEdgeWallSlots | kRimSideSlots) & ~mask; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    set.slots[i].valid = false;
    if (&set == &open_set_ && (closed_ >> i & 1u) && valid(i)) set.slots[i] = closed_set_.slots[i];
  }
  findContacts(now_.edge, shapes_, mask, set);
  ContactSlotMask found = set.valid & mask;
  for (ContactSlotMask left = found; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    const ContactPoint& point = set.slots[i];
    if (point.gap < -kDeepest * scenario_.peg.radius) {
      found &= ~(1u << i);
      continue;
    }
    Touch& touch = touches_[i];
    touch.gap = point.gap - slots_[i].depth;
    touch.r = point.p - now_.k.x;
    touch.velocity = now_.k.v + now_.k.omega.cross(touch.r);
    touch.gap_rate = point.normal.dot(touch.velocity);
    touch.tangential = touch.velocity - touch.gap_rate * point.normal;
  }
  set.valid = (set.valid & ~mask) | found;
}

// all admitted slots at the present evaluation, whatever the bounds say
void Simulation::locateAll() {
  const Kinematics& k = now_.k;
  now_.edge = {k.x - scenario_.peg.half_height * k.a, k.R0, k.R1, scenario_.peg.radius};
  if (closed_) locate(closed_, closed_set_);
  const ContactSlotMask open = admitted_ & ~closed_;
  if (open) locate(open, open_set_);
}

Vector9 Simulation::evaluate(double t, const State& state, Look look) {
  evaluateFree(t, state);
  if (!admitted_ || (look == Look::kForces && !closed_)) return now_.free;

  // closed contacts, and at a step's end the others: not while the edge can't have come down to
  // the block since the clearance was known
  const ContactSlotMask open = admitted_ & ~closed_;
  bool search = false;
  if (look != Look::kForces && open) {
    speed_ = edgeSpeed();
    moved_ = kSpare * (t - time_) * std::max(start_speed_, speed_);
    search = look == Look::kReport || moved_ >= clearance_;
    if (!search) open_set_.valid = 0;
  }
  clear_ = !search && !closed_;
  if (clear_) return now_.free;
  const Kinematics& k = now_.k;
  now_.edge = {k.x - scenario_.peg.half_height * k.a, k.R0, k.R1, scenario_.peg.radius};
  if (closed_) locate(closed_, closed_set_);
  if (search) locate(open, open_set_);
  return closed_ ? withContacts(look) : now_.free;
}

// bound of the speed of the peg's edge
double Simulation::edgeSpeed() const {
  return std::sqrt(2.0 * (now_.k.v.squaredNorm() + arm_ * arm_ * now_.k.omega.squaredNorm()));
}

Body Simulation::body() const {
  Body b;
  const PegParameters& peg = scenario_.peg;
  b.mass = peg.mass;
  b.inertia_transverse = peg.inertia_transverse;
  b.inertia_axial = peg.inertia_axial;
  b.axis = now_.k.a;
  const double it = 1.0 / peg.inertia_transverse, ia = 1.0 / peg.inertia_axial - it;
  b.inverse_inertia = ia * now_.k.a * now_.k.a.transpose();
  b.inverse_inertia.diagonal().array() += it;
  if (scenario_.thesis.moments) {
    // the moment of a contact force as the thesis puts it: Re^-1 instead of its transpose
    b.symmetric = false;
    b.inverse_inertia *= (now_.k.Re * now_.k.Re.transpose()).inverse();
  }
  return b;
}

// v' with the contact forces of the points found
Vector9 Simulation::withContacts(Look look) {
  const Kinematics& k = now_.k;
  const Vec3 angular = k.Re * now_.free.segment<3>(3) + k.Re_rate * now_.rates;
  const bool centripetal = !scenario_.thesis.no_centripetal;
  bool carries = false;
  wedge_margin_ = 1.0;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    Touch& touch = touches_[i];
    touch.normal_force = 0.0;
    touch.force.setZero();
    if (!valid(i)) continue;
    carries = true;
    touch.acceleration = now_.free.head<3>() + angular.cross(touch.r);
    touch.rates = {};
    if (!centripetal) continue;
    touch.acceleration += k.omega.cross(k.omega.cross(touch.r));
    // a rigid flat peg's lowest point has no way along the edge
    const bool flat = rigid() && point(i).feature == ContactFeature::kEdgePlane &&
                      k.a(1) * k.a(1) + k.a(2) * k.a(2) < kFlat * kFlat;
    if (!flat) touch.rates = contactRates(now_.edge, point(i), touch.velocity, k.omega);
  }
  if (!carries) return now_.free;

  if (discreteFriction()) {
    solveModes(look);
  } else {
    solveRegularised();
  }
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const Touch& touch = touches_[static_cast<std::size_t>(__builtin_ctz(left))];
    force += touch.force;
    moment += touch.r.cross(touch.force);
  }
  return now_.free + accelerationBy(force, moment);
}

// of the generalised coordinates by contact forces
Vector9 Simulation::accelerationBy(const Vec3& force, const Vec3& moment) const {
  Vector9 generalised = Vector9::Zero();
  generalised.head<3>() = force;
  generalised.segment<3>(3) = scenario_.thesis.moments ? Vec3(now_.k.Re.inverse() * moment)
                                                       : Vec3(now_.k.Re.transpose() * moment);
  return solveMass(scenario_, now_.k, generalised);
}

// laws A and B with the regularised friction: force direction is known, normal forces by the spring
// or by the linear complementarity of all points in reach. Who carries (slip) or not (idle) and the
// branch of friction are frozen, so that forces are smooth within a step and changes are events;
// where a point is undecided (stick) they are found, the complementarity by enumeration.
void Simulation::solveRegularised() {
  const ContactParameters& c = scenario_.contact;
  bool choose = false;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    choose = choose || slots_[static_cast<std::size_t>(__builtin_ctz(left))].mode == Mode::kStick;
  }
  std::array<std::size_t, kSlots> reach{};
  std::array<Vec3, kSlots> direction;
  std::size_t n = 0;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (!valid(i)) continue;
    const double speed = touches_[i].tangential.norm();
    if (choose) slots_[i].armed = speed > c.regularisation_speed;
    const double mu = slipFriction(slots_[i].armed, speed, c, scenario_.friction);
    Vec3 d = point(i).normal;
    if (speed > 0.0) d -= mu / speed * touches_[i].tangential;
    direction[n] = d;
    reach[n++] = i;
  }
  const auto apply = [&](std::size_t i, double N) {
    touches_[reach[i]].normal_force = N;
    touches_[reach[i]].force = N * direction[i];
  };
  if (c.law == ContactLaw::kSpringDashpot) {
    for (std::size_t i = 0; i < n; ++i) {
      Touch& touch = touches_[reach[i]];
      const double N = -c.stiffness * touch.gap - c.damping * touch.gap_rate;
      if (choose) slots_[reach[i]].mode = N > 0.0 ? Mode::kSlip : Mode::kIdle;
      if (slots_[reach[i]].mode == Mode::kSlip) {
        apply(i, N);
      } else {
        touch.demand = -N / scenario_.peg.mass;
      }
    }
    return;
  }

  // A N + b >= 0 is the complement of N >= 0
  const Body body = this->body();
  Eigen::Matrix<double, kSlots, kSlots> A;
  Eigen::Matrix<double, kSlots, 1> b;
  double scale = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Touch& ti = touches_[reach[i]];
    const Vec3& normal = point(reach[i]).normal;
    const auto row = static_cast<Eigen::Index>(i);
    b(row) = normal.dot(ti.acceleration) + ti.rates.gap_bias + c.rate * ti.gap_rate +
             c.pull_back * ti.gap;
    scale = std::max(scale, std::abs(b(row)));
    for (std::size_t j = 0; j < n; ++j) {
      A(row, static_cast<Eigen::Index>(j)) =
          normal.dot(response(body, ti.r, touches_[reach[j]].r, direction[j]));
    }
  }
  if (n == 1 && scenario_.thesis.sign_flip) {
    slots_[reach[0]].mode = Mode::kSlip;
    apply(0, std::abs(b(0) / A(0, 0)));
    return;
  }
  const bool frozen = !choose && !scenario_.thesis.sign_flip;
  int carriers = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (slots_[reach[i]].mode == Mode::kSlip) carriers |= 1 << i;
  }
  // the subset with the least violation; an exact one ends the search
  Eigen::Matrix<double, kSlots, 1> best = Eigen::Matrix<double, kSlots, 1>::Zero();
  double least = 1e300;
  int chosen = 0;
  const int first = frozen ? carriers : (1 << n) - 1, last = frozen ? carriers : 0;
  for (int subset = first; subset >= last && least > 0.0; --subset) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kSlots> As;
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1> bs;
    std::array<Eigen::Index, kSlots> index{};
    Eigen::Index m = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (subset >> i & 1) index[static_cast<std::size_t>(m++)] = static_cast<Eigen::Index>(i);
    }
    Eigen::Matrix<double, kSlots, 1> trial = Eigen::Matrix<double, kSlots, 1>::Zero();
    if (m == 2) {
      const Eigen::Index i = index[0], j = index[1];
      const double d = A(i, i) * A(j, j) * (1.0 + 2.0 * kShift) - A(i, j) * A(j, i);
      trial(i) = (-b(i) * A(j, j) + A(i, j) * b(j)) / d;
      trial(j) = (-b(j) * A(i, i) + A(j, i) * b(i)) / d;
    } else if (m == 1) {
      trial(index[0]) = -b(index[0]) / A(index[0], index[0]);
    } else if (m > 2) {
      As.resize(m, m);
      bs.resize(m);
      for (Eigen::Index i = 0; i < m; ++i) {
        bs(i) = -b(index[static_cast<std::size_t>(i)]);
        for (Eigen::Index j = 0; j < m; ++j) {
          As(i, j) = A(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(j)]);
        }
        As(i, i) *= 1.0 + kShift;
      }
      const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1> xs = As.partialPivLu().solve(bs);
      for (Eigen::Index i = 0; i < m; ++i) trial(index[static_cast<std::size_t>(i)]) = xs(i);
    }
    double violation = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      violation = std::max(violation, -trial(row) * A(row, row));
      if (subset >> i & 1) continue;
      double w = b(row);
      for (std::size_t j = 0; j < n; ++j) {
        w += A(row, static_cast<Eigen::Index>(j)) * trial(static_cast<Eigen::Index>(j));
      }
      violation = std::max(violation, -w);
    }
    if (!std::isfinite(violation)) continue;
    if (frozen) {
      best = trial;
      chosen = subset;
      break;
    }
    if (scenario_.thesis.sign_flip && subset == (1 << n) - 1) {
      best = trial.cwiseAbs();
      chosen = subset;
      break;
    }
    if (violation < 1e-13 * scale) violation = 0.0;
    if (violation < least) {
      least = violation;
      best = trial.cwiseMax(0.0);
      chosen = subset;
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const bool carries = chosen >> i & 1;
    if (choose) slots_[reach[i]].mode = carries ? Mode::kSlip : Mode::kIdle;
    if (carries) {
      apply(i, best(row));
      continue;
    }
    double& demand = touches_[reach[i]].demand;
    demand = b(row);
    for (std::size_t j = 0; j < n; ++j) {
      demand += A(row, static_cast<Eigen::Index>(j)) * best(static_cast<Eigen::Index>(j));
    }
  }
}

// discrete modes: slipping points have a known force direction (one unknown), sticking points three
void Simulation::solveModes(Look look) {
  const ContactParameters& c = scenario_.contact;
  const bool held = !rigid();  // the rigid law keeps closed contacts shut by projection instead
  const double rate = held ? c.rate : 0.0, pull_back = held ? c.pull_back : 0.0;
  const double creep = scenario_.thesis.creep ? 0.0 : rate;
  const Body body = this->body();
  std::array<Constraint, kSlots> constraints;
  std::array<std::size_t, kSlots> slot_of{};
  std::size_t n = 0, sticks = 0, idle = 0;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    const Slot& slot = slots_[i];
    if (!valid(i)) continue;
    if (slot.mode == Mode::kIdle) {
      ++idle;
      continue;
    }
    const Touch& touch = touches_[i];
    const Vec3& normal = point(i).normal;
    Constraint& row = constraints[n];
    slot_of[n++] = i;
    row.r = touch.r;
    row.normal = normal;
    const double normal_target =
        -rate * touch.gap_rate - pull_back * touch.gap - touch.rates.gap_bias;
    row.stick = slot.mode == Mode::kStick;
    if (!row.stick) {
      // slip that begins has its limit's direction, soon that of the velocity
      const double speed = touch.tangential.norm();
      const double begin = slot.armed ? 0.0 : std::clamp(2.0 - speed / slip_threshold_, 0.0, 1.0);
      Vec3 slip = -begin * slot.slip_direction;
      if (speed > 0.0) slip += (1.0 - begin) / speed * touch.tangential;
      const double size = slip.norm();
      const Vec3 friction = size > 0.0 ? Vec3(slip / -size) : slot.slip_direction;
      row.direction = normal + scenario_.friction.sliding_coefficient * friction;
      row.change = (normal_target - normal.dot(touch.acceleration)) * normal;
    } else {
      // the point of the peg at the contact comes to rest, also while the contact rolls
      ++sticks;
      const Vec3 rolling = touch.rates.rolling - normal * normal.dot(touch.rates.rolling);
      row.change = normal * normal_target - creep * touch.tangential - rolling - touch.acceleration;
    }
  }
  const bool free = solveConstraints(body, constraints.data(), static_cast<int>(n));
  for (std::size_t j = 0; j < n; ++j) {
    Touch& touch = touches_[slot_of[j]];
    touch.force = constraints[j].force;
    touch.normal_force = constraints[j].normal.dot(touch.force);
  }
  if (look == Look::kForces) return;
  if (held && !free && slips()) {
    wedge_margin_ = wedgeMargin(body, constraints.data(), static_cast<int>(n));
  }

  // resting points: the force along their connections moves nothing; any value inside all cones
  // will do, the best one is looked for where the even one is outside
  if (sticks > 1) {
    ContactSlotMask resting = 0;
    for (std::size_t j = 0; j < n; ++j) {
      if (constraints[j].stick) resting |= 1u << slot_of[j];
    }
    if (look == Look::kReport || !inCones(resting, 0.0)) shareInternalForces(resting, kLoads);
  }
  if (!idle) return;
  // what an idle slot's gap would do
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (slots_[i].mode != Mode::kIdle || !valid(i)) continue;
    Touch& touch = touches_[i];
    Vec3 acceleration = touch.acceleration;
    for (std::size_t j = 0; j < n; ++j) {
      acceleration += response(body, touch.r, constraints[j].r, touches_[slot_of[j]].force);
    }
    touch.demand = point(i).normal.dot(acceleration) + touch.rates.gap_bias +
                   rate * touch.gap_rate + pull_back * touch.gap;
  }
}

// tangential force beyond what static friction holds [N]
double Simulation::coneExcess(std::size_t i) const {
  const Touch& touch = touches_[i];
  const Vec3 tangential = touch.force - touch.normal_force * point(i).normal;
  return tangential.norm() - scenario_.friction.static_coefficient * touch.normal_force;
}

// none of these points needs more friction than there is, by more than this [N]
bool Simulation::inCones(ContactSlotMask points, double by) const {
  for (ContactSlotMask left = points; left; left &= left - 1) {
    if (coneExcess(static_cast<std::size_t>(__builtin_ctz(left))) > by) return false;
  }
  return true;
}

// Resting points share the forces along their connections, pair by pair, each up to `most` times
// the load of all.
void Simulation::shareInternalForces(ContactSlotMask points, double most) {
  double load = 0.0;
  for (ContactSlotMask left = points; left; left &= left - 1) {
    load += touches_[static_cast<std::size_t>(__builtin_ctz(left))].force.norm();
  }
  const bool pair = __builtin_popcount(points) < 3;
  for (int round = 0; round < (pair ? 1 : kShares); ++round) {
    for (ContactSlotMask left = points; left; left &= left - 1) {
      for (ContactSlotMask second = left & (left - 1); second; second &= second - 1) {
        shareInternalForce(static_cast<std::size_t>(__builtin_ctz(left)),
                           static_cast<std::size_t>(__builtin_ctz(second)), most * load);
        if (!pair && inCones(points, 0.0)) return;
      }
    }
  }
}

// Two sticking points can't change their distance: the force along their connection is
// undetermined. Of all its values up to `most` take the one farthest inside both friction cones.
void Simulation::shareInternalForce(std::size_t one, std::size_t two, double most) {
  const Vec3 apart = touches_[two].r - touches_[one].r;
  const double distance = apart.norm();
  if (!(distance > 0.0)) return;
  const Vec3 along = apart / distance;
  const double mu = scenario_.friction.static_coefficient;
  // (T + s t)² and N + s n of either point
  struct Cone {
    double tt, ts, ss, N, n;
  };
  const auto cone = [&](std::size_t i, const Vec3& direction) {
    const Vec3& normal = point(i).normal;
    const Vec3 T = touches_[i].force - touches_[i].normal_force * normal;
    const double n = normal.dot(direction);
    const Vec3 t = direction - n * normal;
    return Cone{T.squaredNorm(), 2.0 * T.dot(t), t.squaredNorm(), touches_[i].normal_force, n};
  };
  const Cone c1 = cone(one, along), c2 = cone(two, -along);
  const auto outside = [mu](const Cone& c, double s) {
    return std::sqrt(std::max(0.0, c.tt + s * (c.ts + s * c.ss))) - mu * (c.N + s * c.n);
  };
  const auto worse = [&](double s) { return std::max(outside(c1, s), outside(c2, s)); };
  // convex in s: golden section
  const double golden = 0.6180339887498949;
  double low = -most, high = most;
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double fa = worse(a), fb = worse(b);
  for (int i = 0; i < 48; ++i) {
    if (fa < fb) {
      high = b;
      b = a;
      fb = fa;
      a = high - golden * (high - low);
      fa = worse(a);
    } else {
      low = a;
      a = b;
      fa = fb;
      b = low + golden * (high - low);
      fb = worse(b);
    }
  }
  const double s = 0.5 * (low + high);
  touches_[one].force += s * along;
  touches_[two].force -= s * along;
  touches_[one].normal_force += s * c1.n;
  touches_[two].normal_force += s * c2.n;
}

// which slots are in reach at the present state, then the rest by decide()
void Simulation::findModes(bool initial) {
  for (std::size_t i = 0; i < kSlots; ++i) setMode(i, Mode::kApart);
  if (admitted_) {
    evaluateFree(time_, state_);
    locateAll();
    bool closing = false;
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (!(admitted_ >> i & 1u) || !valid(i)) continue;
      const double gap = touches_[i].gap, rate = touches_[i].gap_rate;
      if (initial && rigid() && gap < -kInitialReach) {
        stop_ = StopReason::kInitialOverlap;
        return;
      }
      const bool touching = gap <= (initial ? kInitialReach : kReach) && rate <= 1e-12;
      if (gap < 0.0 || touching) {
        setMode(i, discreteFriction() ? Mode::kIdle : Mode::kSlip);
        slots_[i].armed = false;
        if (!initial && rigid()) keepDepth(i, 0.0);
        closing = closing || rate < 0.0;
      }
    }
    if (rigid() && (initial || closing)) impact();
  }
  decide();
}

// discrete friction: find for the points in reach who carries force, who slips and who rests;
// `again`: after slip that was stopped here, 1 for having turned, 2 and 3 by a jam
void Simulation::decide(int again) {
  stale_ = false;
  history_.count = 0;
  wedge_margin_ = 1.0;
  evaluateFree(time_, state_);
  if (!admitted_) {
    slope_v_ = now_.free;
    return;
  }
  locateAll();
  if (!discreteFriction() || !closed_) {
    double scale = 1e-3;
    for (ContactSlotMask left = closed_; left; left &= left - 1) {
      const auto i = static_cast<std::size_t>(__builtin_ctz(left));
      slots_[i].mode = Mode::kStick;  // undecided
      if (valid(i)) scale = std::max(scale, std::abs(point(i).normal.dot(now_.free.head<3>())));
    }
    approach_ = 1e-4 * kHysteresis * scale;
    pull_ = approach_ * scenario_.peg.mass;
    slope_v_ = closed_ ? withContacts(Look::kEvents) : now_.free;
    startStep();
    return;
  }
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (!(closed_ >> i & 1u) || !valid(i)) continue;
    Slot& slot = slots_[i];
    slot.armed = touches_[i].tangential.norm() > kRest * slip_threshold_;
    slot.mode = slot.armed ? Mode::kSlip : Mode::kStick;
  }
  double limit = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    slope_v_ = withContacts(Look::kEvents);
    if (pass == 0) {
      // forces and accelerations that count here
      double scale = 1e-3;
      for (std::size_t i = 0; i < kSlots; ++i) {
        if (!(closed_ >> i & 1u) || !valid(i)) continue;
        const Touch& touch = touches_[i];
        scale = std::max(scale, std::abs(point(i).normal.dot(touch.acceleration)) +
                                    std::abs(touch.rates.gap_bias));
      }
      // decisions go by half the smaller of the old and the new limit, so that what made an event
      // is found
      const double fine = std::clamp(scenario_.solver.tolerance / 1e-9, 1e-3, 1.0);
      const double change = kHysteresis * fine * scale;
      limit = 0.5 * (approach_ > 0.0 ? std::min(approach_, change) : change);
      approach_ = change;
      pull_ = approach_ * scenario_.peg.mass;
    }
    // the worst offender changes: pulled, beyond the cone, or idle but approaching
    std::size_t worst = kSlots;
    Mode change = Mode::kIdle;
    double excess = limit * scenario_.peg.mass;
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (!(closed_ >> i & 1u) || !valid(i) || slots_[i].mode == Mode::kIdle) continue;
      if (touches_[i].normal_force < -excess) {
        excess = -touches_[i].normal_force;
        worst = i;
        change = Mode::kIdle;
      }
    }
    if (worst == kSlots) {
      for (std::size_t i = 0; i < kSlots; ++i) {
        if (!(closed_ >> i & 1u) || !valid(i) || slots_[i].mode != Mode::kStick) continue;
        const double over = coneExcess(i);
        if (over > excess) {
          excess = over;
          worst = i;
          change = Mode::kSlip;
        }
      }
    }
    if (worst == kSlots && pass < kPasses / 2) {
      excess = limit;
      for (std::size_t i = 0; i < kSlots; ++i) {
        if (!(closed_ >> i & 1u) || !valid(i) || slots_[i].mode != Mode::kIdle) continue;
        if (touches_[i].demand < -excess) {
          excess = -touches_[i].demand;
          worst = i;
          change = slots_[i].armed ? Mode::kSlip : Mode::kStick;
        }
      }
    }
    if (worst == kSlots) break;
    if (change == Mode::kSlip && !slots_[worst].armed) {
      const Vec3 tangential =
          touches_[worst].force - touches_[worst].normal_force * point(worst).normal;
      const double size = tangential.norm();
      slots_[worst].slip_direction = size > 0.0 ? Vec3(tangential / size) : Vec3(Vec3::Zero());
    }
    slots_[worst].mode = change;
  }
  turnSlip();
  if (again == 0 && stopTurnedSlip()) return decide(1);
  if (!rigid() && again < 3 && slips() && (wedge_margin_ < 2.0 * kWedged || contradicted(limit))) {
    jam(again == 2);
    return decide(again == 2 ? 3 : 2);
  }
  if (rigid() && time_ >= coarse_until_) {
    project();
    slope_v_ = evaluate(time_, state_, Look::kEvents);
  }
  startStep();
}

// no choice of modes has been found that all points agree with
bool Simulation::contradicted(double limit) const {
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (!valid(i)) continue;
    const bool idle = slots_[i].mode == Mode::kIdle;
    if (idle ? touches_[i].demand < -limit
             : touches_[i].normal_force < -limit * scenario_.peg.mass) {
      return true;
    }
  }
  return false;
}

// Slip that begins goes where the point is accelerated to, which depends on the friction against it
// (prox iteration); where the friction still holds the point, against the friction.
void Simulation::turnSlip() {
  const double mu = scenario_.friction.sliding_coefficient;
  if (mu == 0.0) return;
  for (int turn = 0; turn < kTurns; ++turn) {
    double largest = 0.0;
    const Body body = this->body();
    const std::array<Touch, kSlots> at = touches_;
    for (std::size_t i = 0; i < kSlots; ++i) {
      Slot& slot = slots_[i];
      if (!(closed_ >> i & 1u) || slot.mode != Mode::kSlip || slot.armed || !valid(i)) continue;
      const Vec3& normal = point(i).normal;
      Vec3 acceleration = at[i].acceleration + at[i].rates.rolling;
      for (std::size_t j = 0; j < kSlots; ++j) {
        if (closed_ >> j & 1u) acceleration += response(body, at[i].r, at[j].r, at[j].force);
      }
      acceleration -= normal * normal.dot(acceleration);
      const Vec3 tangent = slot.slip_direction - normal * normal.dot(slot.slip_direction);
      const double give =
          mu * at[i].normal_force * tangent.dot(response(body, at[i].r, at[i].r, tangent));
      const Vec3 next = tangent - acceleration / give;
      const double size = next.norm();
      if (!(give > 0.0) || !(size > 0.0) || !std::isfinite(size)) continue;
      largest = std::max(largest, (next / size - slot.slip_direction).norm());
      slot.slip_direction = next / size;
    }
    if (largest < 1e-14) return;
    slope_v_ = withContacts(Look::kEvents);
    if (largest < 1e-12) return;
  }
}

// Slip that begins has a friction of fixed direction. Below zero: it goes elsewhere than against
// that, fast enough to tell; under the rigid law, which keeps resting points at zero speed, only
// when it goes along with it [m/s].
double Simulation::slipAhead(std::size_t i) const {
  const Vec3& slip = touches_[i].tangential;
  const double against = -slip.dot(slots_[i].slip_direction);
  if (rigid()) return slip_threshold_ + against;
  if (scenario_.friction.sliding_coefficient == 0.0) return HUGE_VAL;
  const double speed = slip.norm();
  return std::max(slip_threshold_ - speed, against - kAhead * speed);
}

// Slip that has begun one way and goes another gets the friction of its velocity. Where that brakes
// it, it would come to rest at once: it is put to rest, and all is decided anew (true).
bool Simulation::stopTurnedSlip() {
  ContactSlotMask turned = 0;
  if (rigid()) return false;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    Slot& slot = slots_[i];
    if (slot.mode != Mode::kSlip || slot.armed || !valid(i) || slipAhead(i) >= 0.0) continue;
    slot.armed = true;
    turned |= 1u << i;
  }
  if (!turned) return false;
  slope_v_ = withContacts(Look::kEvents);
  const Body body = this->body();
  std::array<Constraint, kSlots> rows;
  std::size_t n = 0;
  bool stops = false;
  for (ContactSlotMask left = closed_; left; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    if (slots_[i].mode == Mode::kIdle || !valid(i)) continue;
    const Touch& touch = touches_[i];
    bool stop = false;
    if (turned >> i & 1u) {
      Vec3 acceleration = touch.acceleration + touch.rates.rolling;
      for (ContactSlotMask others = closed_; others; others &= others - 1) {
        const auto j = static_cast<std::size_t>(__builtin_ctz(others));
        acceleration += response(body, touch.r, touches_[j].r, touches_[j].force);
      }
      stop = acceleration.dot(touch.tangential) < 0.0;
    }
    Constraint& row = rows[n++];
    row.stick = stop || slots_[i].mode == Mode::kStick;
    row.r = touch.r;
    row.normal = row.direction = point(i).normal;
    row.change = stop ? Vec3(-touch.tangential) : Vec3(Vec3::Zero());
    stops = stops || stop;
  }
  if (!stops) return false;
  solveConstraints(body, rows.data(), static_cast<int>(n));
  Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t j = 0; j < n; ++j) {
    impulse += rows[j].force;
    moment += rows[j].r.cross(rows[j].force);
  }
  applyImpulse(impulse, moment);
  return true;
}

}  // namespace assembly_cell
