// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/simulation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/scene/input_error.h"
#include "contact_algebra.h"

namespace assembly_cell {
namespace {

constexpr double kReach = 1e-9;         // a slot leaves reach above this gap [m]
constexpr double kInitialReach = 1e-8;  // closed at the start up to this gap [m]
constexpr double kDeepest = 0.1;        // penetration beyond this part of the radius is no contact
constexpr double kPull = 1e-7;          // forces this far beyond a limit change no mode [N]
constexpr double kApproach = 1e-6;      // nor does an idle gap's acceleration down to this [m/s²]
constexpr double kRigidRate = 1e3;      // decay of what rounding leaves of closed contacts [1/s]
constexpr double kRigidGap = 1e-12;     // an open rigid contact closes below minus this [m]
constexpr double kEventTime = 1e-12;    // events are located to this [s]
// as many events as are remembered within kCluster are a cluster (a peg that lies flat, rocking):
// for kCoarseSpan the run goes on in steps of kCoarseStep without locating events [s]
constexpr double kCluster = 2e-4, kCoarseSpan = 2e-3, kCoarseStep = 2e-5;
constexpr double kStepFloor = 1e-13;  // error control below this step gives up [s]
constexpr std::int64_t kEventLimit = 10000000;
using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
EdgeCircle edgeOf(const Scenario& s, const Kinematics& k) {
  return {k.x - s.peg.half_height * k.a, k.R0, k.R1, s.peg.radius};
}

double slipFriction(double speed, const ContactParameters& c, const FrictionParameters& f) {
  return speed <= c.regularisation_speed ? f.static_coefficient * speed / c.regularisation_speed
                                         : f.sliding_coefficient;
}

// Dormand–Prince 5(4)
constexpr double kA[7][6] = {
    {0, 0, 0, 0, 0, 0},
    {1.0 / 5, 0, 0, 0, 0, 0},
    {3.0 / 40, 9.0 / 40, 0, 0, 0, 0},
    {44.0 / 45, -56.0 / 15, 32.0 / 9, 0, 0, 0},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729, 0, 0},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656, 0},
    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
constexpr double kC[7] = {0, 0.2, 0.3, 0.8, 8.0 / 9, 1, 1};
constexpr double kE[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                          -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

}  // namespace

const char* toString(StopReason reason) {
  switch (reason) {
    case StopReason::kOk:
      return "ok";
    case StopReason::kEdgePlane:
      return "edge_plane";
    case StopReason::kSingular:
      return "singular_orientation";
    case StopReason::kInitialOverlap:
      return "initial_overlap";
    case StopReason::kNonFinite:
      return "non_finite";
    case StopReason::kStepTooSmall:
      return "step_too_small";
    case StopReason::kEventLimit:
      return "event_limit";
  }
  return "unknown";
}

Simulation::Simulation(const Scenario& scenario) : scenario_(scenario) {
  if (rigid() && scenario_.contact.restitution > 0.0) {
    throw InputError("contact.restitution: " + std::to_string(scenario_.contact.restitution) +
                     " is not available; the rigid law's impacts are plastic, use 0");
  }
  if (rigid()) {
    scenario_.contact.rate = kRigidRate;
    scenario_.contact.pull_back = 0.0;
  }
  const SolverParameters& solver = scenario_.solver;
  if (solver.integrator == "rk4") {
    fixed_step_ = true;
    if (!(solver.step > 0.0)) {
      throw InputError("solver.step: integrator rk4 needs a fixed step; set solver.step > 0 [s]");
    }
  } else if (solver.integrator != "dopri5") {
    throw InputError("solver.integrator: " + solver.integrator +
                     " is not available; use dopri5 or rk4");
  }
  // slip is told from rest above the integrator's velocity error
  slip_threshold_ = std::max(1e-8, 1e4 * (fixed_step_ ? 1e-9 : solver.tolerance));
  profile_ = restProfile(scenario_.rest);
  drive_.exciter = scenario_.exciter;

  const InitialState& s = scenario_.initial;
  State start;
  start.q.head<3>() = toThesisAxes(s.position);
  start.q.segment<3>(3) << s.euler.phi, s.euler.theta, s.euler.psi;
  start.q.tail<3>() << s.carrier_x, s.carrier_y, s.carrier_yaw;
  start.v.head<3>() = toThesisAxes(s.velocity);
  start.v.segment<3>(3) = s.euler_rates;
  start.v.tail<3>() = s.carrier_velocity;

  // lower the peg until the smallest gap is zero: gaps fall with the height
  if (s.close) {
    const auto smallest = [&](double z) {
      State at = start;
      at.q(0) = z;
      const EdgeCircle edge = edgeOf(scenario_, kinematics(at));
      double gap = 1.0;
      if (scenario_.contact.features.edge_edge) {
        for (int slot = 0; slot < 2; ++slot) {
          const ContactPoint c = findEdgeEdge(edge, scenario_.hole.radius, slot, false, 0.0);
          if (c.valid) gap = std::min(gap, c.gap);
        }
      }
      if (scenario_.contact.features.edge_plane) {
        const ContactPoint c = findEdgePlane(edge, scenario_.hole.radius);
        if (c.valid) gap = std::min(gap, c.gap);
      }
      return gap;
    };
    double high = start.q(0), low = high;
    const double span = scenario_.peg.half_height + scenario_.peg.radius;
    double step = 1e-4 * span;
    while (smallest(high) <= 0.0 && high < start.q(0) + 2 * span) high += step, step *= 1.5;
    step = 1e-4 * span;
    while (smallest(low) > 0.0 && low > start.q(0) - 4 * span) {
      high = low;
      low -= step;
      step = std::min(1.2 * step, 0.02 * span);
    }
    if (smallest(low) > 0.0 || smallest(high) <= 0.0) {
      throw InputError(
          "initial.close: true, but lowering the peg closes no contact of contact.features; "
          "move initial.peg.position over the block or set close: false");
    }
    for (int i = 0; i < 200 && high - low > 1e-17; ++i) {
      const double middle = 0.5 * (low + high);
      (smallest(middle) > 0.0 ? high : low) = middle;
    }
    start.q(0) = high;
  }
  setState(start);
  if (stop_ == StopReason::kInitialOverlap) {
    throw InputError(
        "initial.peg.position: the peg's edge is more than 1e-8 m inside the block, which the "
        "rigid law "
        "refuses; raise it or set initial.close: true");
  }
}

bool Simulation::finite(const State& s) const { return s.q.allFinite() && s.v.allFinite(); }

bool Simulation::discreteFriction() const {
  return rigid() ||
         (scenario_.contact.law == ContactLaw::kViscous && scenario_.contact.stationary_rows);
}

void Simulation::setRestTarget(const RestPose& target) {
  const double arm = scenario_.peg.coupling_height + scenario_.peg.half_height;
  profile_ = planRest(restAt(time_), time_, target, scenario_.carrier, arm);
  stale_ = true;
}

void Simulation::setExciter(const ExciterParameters& exciter, double t_ref) {
  drive_.exciter = exciter;
  drive_.t_ref = t_ref;
  stale_ = true;
}

void Simulation::setState(const State& state) {
  state_ = state;
  stop_ = StopReason::kOk;
  next_step_ = scenario_.solver.max_step;
  slots_ = Slots{};
  recent_events_.fill(-1.0);
  coarse_until_ = -1.0;
  if (!finite(state_)) {
    stop_ = StopReason::kNonFinite;
    return;
  }
  if (std::sin(state_.q(4)) < 0.1) {
    stop_ = StopReason::kSingular;
    return;
  }
  findModes(true);
}

// geometry and velocities of the slots; no search while the lowest edge point is above the plane
void Simulation::locate(const Kinematics& k, Slots& slots) {
  const EdgeCircle edge = edgeOf(scenario_, k);
  const EdgeHeight height = edgeHeight(edge);
  const ContactFeatures& features = scenario_.contact.features;
  const double margin = kInitialReach;
  const bool near = height.lowest() <= margin;
  const bool below = height.highest() < -kDeepest * scenario_.peg.radius;
  for (int i = 0; i < kSlots; ++i) {
    Slot& slot = slots[static_cast<std::size_t>(i)];
    if (!near || (i < 2 && (below || !features.edge_edge))) {
      slot.point.valid = false;
      continue;
    }
    slot.point = i < 2
                     ? findEdgeEdge(edge, scenario_.hole.radius, i, slot.point.valid, slot.point.t)
                     : findEdgePlane(edge, scenario_.hole.radius);
    if (slot.point.valid && slot.point.gap < -kDeepest * scenario_.peg.radius) {
      slot.point.valid = false;
    }
    if (!slot.point.valid) continue;
    slot.r = slot.point.p - k.x;
    slot.velocity = k.v + k.omega.cross(slot.r);
    slot.gap_rate = slot.point.normal.dot(slot.velocity);
    slot.tangential = slot.velocity - slot.gap_rate * slot.point.normal;
    if (slot.mode != Mode::kApart) {
      slot.rates = contactRates(edge, slot.point, slot.velocity, k.omega);
    }
  }
}

// v' at a state with the slots' modes as they are; fills forces and what events need. `share`: also
// the internal force of two resting points, which moves nothing
Vector9 Simulation::evaluate(double t, const State& state, Slots& slots, bool share) {
  ++counts_.evaluations;
  const Kinematics k = kinematics(state);
  motion_ = freeMotion(scenario_, k, state, restAt(t), drive_, t);
  const Vector9 free = solveMass(scenario_, k, motion_.force);
  if (scenario_.contact.law == ContactLaw::kNone) return free;

  locate(k, slots);
  bool in_reach = false;
  const Vec3 angular = k.Re * free.segment<3>(3) + k.Re_rate * state.v.segment<3>(3);
  for (Slot& slot : slots) {
    slot.normal_force = 0.0;
    slot.force.setZero();
    if (slot.mode == Mode::kApart || !slot.point.valid) continue;
    in_reach = true;
    slot.acceleration =
        free.head<3>() + angular.cross(slot.r) + k.omega.cross(k.omega.cross(slot.r));
  }
  if (!in_reach) return free;

  if (discreteFriction()) {
    solveModes(k, slots, share);
  } else {
    solveRegularised(k, slots);
  }
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (const Slot& slot : slots) {
    force += slot.force;
    moment += slot.r.cross(slot.force);
  }
  Vector9 total = motion_.force;
  total.head<3>() += force;
  total.segment<3>(3) += k.Re.transpose() * moment;
  return solveMass(scenario_, k, total);
}

// laws A and B with the regularised friction: force direction is known, normal forces by the spring
// or by the linear complementarity of all points in reach (enumerated)
void Simulation::solveRegularised(const Kinematics& k, Slots& slots) const {
  const ContactParameters& c = scenario_.contact;
  std::array<Slot*, kSlots> reach{};
  std::array<Vec3, kSlots> direction;
  int n = 0;
  for (Slot& slot : slots) {
    if (slot.mode == Mode::kApart || !slot.point.valid) continue;
    const double speed = slot.tangential.norm();
    const double mu = slipFriction(speed, c, scenario_.friction);
    Vec3 d = slot.point.normal;
    if (speed > 0.0) d -= mu / speed * slot.tangential;
    direction[static_cast<std::size_t>(n)] = d;
    reach[static_cast<std::size_t>(n++)] = &slot;
  }

  std::array<double, kSlots> N{};
  if (c.law == ContactLaw::kSpringDashpot) {
    for (int i = 0; i < n; ++i) {
      const Slot& s = *reach[static_cast<std::size_t>(i)];
      N[static_cast<std::size_t>(i)] =
          s.point.gap < 0.0 ? std::max(0.0, -c.stiffness * s.point.gap - c.damping * s.gap_rate)
                            : 0.0;
    }
  } else {
    // A N + b >= 0 is the complement of N >= 0
    Mat3 A = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    for (int i = 0; i < n; ++i) {
      const Slot& si = *reach[static_cast<std::size_t>(i)];
      b(i) = si.point.normal.dot(si.acceleration) + si.rates.gap_bias + c.rate * si.gap_rate +
             c.pull_back * si.point.gap;
      for (int j = 0; j < n; ++j) {
        const Slot& sj = *reach[static_cast<std::size_t>(j)];
        A(i, j) = si.point.normal.dot(influence(scenario_.peg, k.a, si.r, sj.r) *
                                      direction[static_cast<std::size_t>(j)]);
      }
    }
    // the subset with the least violation; an exact one ends the search
    double least = 1e300;
    for (int subset = (1 << n) - 1; subset >= 0 && least > 0.0; --subset) {
      Small<kSlots> As;
      SmallVector<kSlots> bs;
      std::array<int, kSlots> index{};
      int m = 0;
      for (int i = 0; i < n; ++i) {
        if (subset >> i & 1) index[static_cast<std::size_t>(m++)] = i;
      }
      Vec3 trial = Vec3::Zero();
      if (m > 0) {
        As.resize(m, m);
        bs.resize(m);
        for (int i = 0; i < m; ++i) {
          bs(i) = -b(index[static_cast<std::size_t>(i)]);
          for (int j = 0; j < m; ++j) {
            As(i, j) = A(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(j)]);
          }
          As(i, i) *= 1.0 + kShift;
        }
        const SmallVector<kSlots> xs = As.partialPivLu().solve(bs);
        for (int i = 0; i < m; ++i) trial(index[static_cast<std::size_t>(i)]) = xs(i);
      }
      if (!trial.allFinite()) continue;
      const Vec3 w = A * trial + b;
      double violation = 0.0;
      const double scale = b.cwiseAbs().maxCoeff();
      for (int i = 0; i < n; ++i) {
        violation = std::max(violation, -trial(i) * A(i, i));
        if (!(subset >> i & 1)) violation = std::max(violation, -w(i));
      }
      if (violation < 1e-13 * scale) violation = 0.0;
      if (violation < least) {
        least = violation;
        for (int i = 0; i < n; ++i) N[static_cast<std::size_t>(i)] = std::max(0.0, trial(i));
      }
    }
  }
  for (int i = 0; i < n; ++i) {
    Slot& slot = *reach[static_cast<std::size_t>(i)];
    slot.normal_force = N[static_cast<std::size_t>(i)];
    slot.force = slot.normal_force * direction[static_cast<std::size_t>(i)];
  }
}

// law B with discrete stationary rows: slipping points have a known force direction (one unknown),
// sticking points three; one linear system, shifted so that redundant sticking stays solvable
void Simulation::solveModes(const Kinematics& k, Slots& slots, bool share) const {
  const ContactParameters& c = scenario_.contact;
  struct Column {
    Slot* slot;
    Vec3 row, direction;
    double target;
  };
  std::array<Column, 3 * kSlots> columns;
  int n = 0;
  for (Slot& slot : slots) {
    if (slot.mode != Mode::kSlip && slot.mode != Mode::kStick) continue;
    if (!slot.point.valid) continue;
    const Vec3& normal = slot.point.normal;
    const double normal_target =
        -c.rate * slot.gap_rate - c.pull_back * slot.point.gap - slot.rates.gap_bias;
    if (slot.mode == Mode::kSlip) {
      const Vec3 friction = slot.armed ? Vec3(-slot.tangential.normalized()) : slot.slip_direction;
      columns[static_cast<std::size_t>(n++)] = {
          &slot, normal, normal + scenario_.friction.sliding_coefficient * friction,
          normal_target - normal.dot(slot.acceleration)};
    } else {
      // the point of the peg at the contact comes to rest at rate k, also while the contact rolls
      const Vec3 rolling = slot.rates.rolling - normal * normal.dot(slot.rates.rolling);
      const Vec3 target =
          normal * normal_target - c.rate * slot.tangential - rolling - slot.acceleration;
      for (int i = 0; i < 3; ++i) {
        columns[static_cast<std::size_t>(n++)] = {&slot, Vec3::Unit(i), Vec3::Unit(i), target(i)};
      }
    }
  }
  SmallVector<3 * kSlots> x(n);
  if (n > 0) {
    Small<3 * kSlots> A(n, n);
    SmallVector<3 * kSlots> b(n);
    for (int i = 0; i < n; ++i) {
      const Column& ci = columns[static_cast<std::size_t>(i)];
      b(i) = ci.target;
      for (int j = 0; j < n; ++j) {
        const Column& cj = columns[static_cast<std::size_t>(j)];
        A(i, j) = ci.row.dot(influence(scenario_.peg, k.a, ci.slot->r, cj.slot->r) * cj.direction);
      }
    }
    if (n > 3) A.diagonal() *= 1.0 + kShift;
    x = A.partialPivLu().solve(b);
    for (int i = 0; i < n; ++i) {
      const Column& ci = columns[static_cast<std::size_t>(i)];
      ci.slot->force += x(i) * ci.direction;
    }
  }
  if (share) shareInternalForce(slots);
  for (Slot& slot : slots) {
    if (slot.mode == Mode::kApart || !slot.point.valid) continue;
    slot.normal_force = slot.point.normal.dot(slot.force);
  }
  // what an idle slot's gap would do
  for (Slot& slot : slots) {
    if (slot.mode != Mode::kIdle || !slot.point.valid) continue;
    Vec3 acceleration = slot.acceleration;
    for (const Slot& other : slots) {
      if (other.mode == Mode::kSlip || other.mode == Mode::kStick) {
        acceleration += influence(scenario_.peg, k.a, slot.r, other.r) * other.force;
      }
    }
    slot.demand = slot.point.normal.dot(acceleration) + slot.rates.gap_bias +
                  c.rate * slot.gap_rate + c.pull_back * slot.point.gap;
  }
}

// Two sticking points can't change their distance: the force along their connection is
// undetermined. Of all its values take the one farthest inside both friction cones.
void Simulation::shareInternalForce(Slots& slots) const {
  Slot* one = nullptr;
  Slot* two = nullptr;
  for (Slot& slot : slots) {
    if (slot.mode != Mode::kStick || !slot.point.valid) continue;
    (one ? two : one) = &slot;
  }
  if (!two) return;
  const Vec3 apart = two->point.p - one->point.p;
  const double distance = apart.norm();
  if (!(distance > 0.0)) return;
  const Vec3 along = apart / distance;
  const double mu = scenario_.friction.static_coefficient;
  const auto outside = [mu](const Vec3& force, const Vec3& normal) {
    const double N = normal.dot(force);
    return (force - N * normal).norm() - mu * N;
  };
  const auto worse = [&](double s) {
    return std::max(outside(one->force + s * along, one->point.normal),
                    outside(two->force - s * along, two->point.normal));
  };
  // convex in s: golden section
  const double golden = 0.6180339887498949;
  double low = -2.0 * (one->force.norm() + two->force.norm()), high = -low;
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double fa = worse(a), fb = worse(b);
  for (int i = 0; i < 36; ++i) {
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
  one->force += s * along;
  two->force -= s * along;
}

// which slots are in reach at the present state, then the rest by decide()
void Simulation::findModes(bool initial) {
  const Kinematics k = kinematics(state_);
  for (Slot& slot : slots_) slot.mode = Mode::kApart;
  if (scenario_.contact.law != ContactLaw::kNone) {
    locate(k, slots_);
    for (Slot& slot : slots_) {
      if (!slot.point.valid) continue;
      const bool touching = initial && slot.point.gap <= kInitialReach && slot.gap_rate <= 1e-12;
      if (initial && rigid() && slot.point.gap < -kInitialReach) {
        stop_ = StopReason::kInitialOverlap;
        return;
      }
      if (slot.point.gap < 0.0 || touching) {
        slot.mode = discreteFriction() ? Mode::kIdle : Mode::kSlip;
      }
    }
  }
  if (initial && rigid()) impact();
  decide();
}

// discrete friction: find for the points in reach who carries force, who slips and who rests
void Simulation::decide() {
  stale_ = false;
  if (!discreteFriction()) {
    slope_v_ = evaluate(time_, state_, slots_);
    return;
  }
  const double threshold = slip_threshold_;
  for (Slot& slot : slots_) {
    if (slot.mode == Mode::kApart || !slot.point.valid) continue;
    const double speed = slot.tangential.norm();
    if (speed > 1.5 * threshold) {
      slot.mode = Mode::kSlip;
      slot.armed = true;
    } else {
      slot.mode = Mode::kStick;
      slot.armed = false;
    }
  }
  for (int pass = 0; pass < 16; ++pass) {
    slope_v_ = evaluate(time_, state_, slots_);
    // the worst offender changes: pulled, beyond the cone, or idle but approaching
    Slot* worst = nullptr;
    Mode change = Mode::kIdle;
    double excess = 0.0;
    for (Slot& slot : slots_) {
      if (slot.mode == Mode::kApart || !slot.point.valid) continue;
      if (slot.mode != Mode::kIdle && slot.normal_force < -std::max(excess, 0.5 * kPull)) {
        excess = -slot.normal_force;
        worst = &slot;
        change = Mode::kIdle;
      }
    }
    if (!worst) {
      for (Slot& slot : slots_) {
        if (slot.mode != Mode::kStick || !slot.point.valid) continue;
        const Vec3 tangential = slot.force - slot.normal_force * slot.point.normal;
        const double over =
            tangential.norm() - scenario_.friction.static_coefficient * slot.normal_force;
        if (over > std::max(excess, 0.5 * kPull)) {
          excess = over;
          worst = &slot;
          change = Mode::kSlip;
        }
      }
    }
    if (!worst && pass < 12) {
      for (Slot& slot : slots_) {
        if (slot.mode == Mode::kIdle && slot.point.valid &&
            slot.demand < -std::max(excess, 0.5 * kApproach)) {
          excess = -slot.demand;
          worst = &slot;
          change = Mode::kStick;
        }
      }
      if (worst && worst->tangential.norm() > 1.5 * threshold) change = Mode::kSlip;
    }
    if (!worst) break;
    if (change == Mode::kSlip && !worst->armed) {
      const Vec3 tangential = worst->force - worst->normal_force * worst->point.normal;
      worst->slip_direction =
          tangential.norm() > 0.0 ? Vec3(tangential.normalized()) : Vec3(Vec3::Zero());
    }
    worst->mode = change;
  }
  if (rigid()) {
    project();
    slope_v_ = evaluate(time_, state_, slots_);
  }
}

// one step of size h from the present state with the modes frozen; returns the error relative to
// the tolerance (0 for a fixed step)
double Simulation::tryStep(double h, State& end, Vector9& slope, Slots& slots) {
  Vector9 kq[7], kv[7];
  kq[0] = state_.v;
  kv[0] = slope_v_;
  if (fixed_step_) {
    const double c[4] = {0.0, 0.5, 0.5, 1.0};
    for (int i = 1; i < 4; ++i) {
      State s;
      s.q = state_.q + c[i] * h * kq[i - 1];
      s.v = state_.v + c[i] * h * kv[i - 1];
      kq[i] = s.v;
      kv[i] = evaluate(time_ + c[i] * h, s, slots, false);
    }
    end.q = state_.q + h / 6.0 * (kq[0] + 2.0 * kq[1] + 2.0 * kq[2] + kq[3]);
    end.v = state_.v + h / 6.0 * (kv[0] + 2.0 * kv[1] + 2.0 * kv[2] + kv[3]);
    slope = evaluate(time_ + h, end, slots);
    return 0.0;
  }
  for (int i = 1; i < 7; ++i) {
    State s = state_;
    for (int j = 0; j < i; ++j) {
      if (kA[i][j] == 0.0) continue;
      s.q += h * kA[i][j] * kq[j];
      s.v += h * kA[i][j] * kv[j];
    }
    if (i == 6) end = s;
    kq[i] = s.v;
    kv[i] = evaluate(time_ + kC[i] * h, s, slots, i == 6);
  }
  slope = kv[6];
  Vector9 eq = Vector9::Zero(), ev = Vector9::Zero();
  for (int i = 0; i < 7; ++i) {
    eq += h * kE[i] * kq[i];
    ev += h * kE[i] * kv[i];
  }
  static const Vector9 scale = (Vector9() << 1, 1, 1, 30, 30, 30, 1, 1, 30).finished();
  const double tolerance = scenario_.solver.tolerance;
  const double position = eq.cwiseQuotient(scale).cwiseAbs().maxCoeff() / tolerance;
  const double velocity = ev.cwiseQuotient(scale).cwiseAbs().maxCoeff() / (30.0 * tolerance);
  return std::max(position, velocity);
}

// the smallest of the slots' event functions; below zero a mode must change
double Simulation::eventValue(const Slots& start, const Slots& end) const {
  double value = 1.0;
  const double mu = scenario_.friction.static_coefficient;
  for (std::size_t i = 0; i < kSlots; ++i) {
    const Slot& s = end[i];
    if (s.mode == Mode::kApart) {
      if (s.point.valid) {
        // a rigid contact that is just leaving may still be at its rounding
        const bool leaving = rigid() && s.point.gap > -kReach && s.gap_rate > 0.0;
        if (!leaving) value = std::min(value, s.point.gap + (rigid() ? kRigidGap : 0.0));
      }
      continue;
    }
    if (!s.point.valid) return -1.0;
    value = std::min(value, kReach - s.point.gap);
    if (!discreteFriction()) continue;
    if (s.mode == Mode::kIdle) {
      value = std::min(value, s.demand + kApproach);
      continue;
    }
    value = std::min(value, s.normal_force + kPull);
    if (s.mode == Mode::kStick) {
      const double tangential = (s.force - s.normal_force * s.point.normal).norm();
      value = std::min(value, mu * s.normal_force + kPull - tangential);
    } else if (s.armed) {
      const double forward = s.tangential.dot(start[i].tangential.normalized());
      value = std::min(value, forward - slip_threshold_);
    } else {
      value = std::min(value, slip_threshold_ - s.tangential.dot(s.slip_direction));
    }
  }
  return value;
}

void Simulation::accept(double t, const State& end, const Vector9& slope, const Slots& slots) {
  time_ = t;
  state_ = end;
  slope_v_ = slope;
  slots_ = slots;
  ++counts_.steps;
  for (Slot& slot : slots_) {
    if (slot.mode == Mode::kSlip && slot.tangential.norm() > 2.0 * slip_threshold_) {
      slot.armed = true;
    }
  }
  if (rigid()) project();
}

void Simulation::refresh() {
  if (!stale_) return;
  slope_v_ = evaluate(time_, state_, slots_);
  stale_ = false;
}

StopReason Simulation::advance(double t_end) {
  if (stop_ != StopReason::kOk) return stop_;
  // forces jump with the commands: decide anew who slips
  if (stale_) decide();
  const double resolution = 4e-16 * std::max(1.0, std::abs(t_end));
  State end;
  Vector9 slope;
  while (time_ < t_end) {
    double h =
        fixed_step_ ? scenario_.solver.step : std::min(next_step_, scenario_.solver.max_step);
    bool last = false;
    if (time_ + h >= t_end - resolution) {
      h = t_end - time_;
      last = true;
    }

    Slots slots = slots_;
    const double error = tryStep(h, end, slope, slots);
    if (!finite(end) || !slope.allFinite() || !std::isfinite(error) || error > 1.0) {
      ++counts_.rejected;
      const double factor = std::isfinite(error) ? std::max(0.2, 0.9 * std::pow(error, -0.2)) : 0.1;
      if (fixed_step_ || h * factor < kStepFloor) {
        stop_ = finite(end) ? StopReason::kStepTooSmall : StopReason::kNonFinite;
        return stop_;
      }
      next_step_ = h * factor;
      continue;
    }
    if (!fixed_step_ && (!last || error > 0.5)) {
      next_step_ = h * std::clamp(0.9 * std::pow(std::max(error, 1e-10), -0.2), 0.2, 5.0);
    }

    const bool contacts_matter = scenario_.contact.law != ContactLaw::kNone;
    const double value = contacts_matter ? eventValue(slots_, slots) : 1.0;
    const bool coarse = time_ < coarse_until_;
    if (value >= 0.0 || coarse) {
      // amid a cluster of events: short steps, modes decided after each, nothing located
      if (coarse && h > kCoarseStep) {
        h = kCoarseStep;
        last = false;
        slots = slots_;
        tryStep(h, end, slope, slots);
      }
      accept(last ? t_end : time_ + h, end, slope, slots);
      if (coarse) findModes(false);
    } else {
      // bracket the first change: Illinois with bisection against jumps
      double low = 0.0, high = h, f_low = eventValue(slots_, slots_), f_high = value;
      State state_high = end;
      Vector9 slope_high = slope;
      Slots slots_high = slots;
      if (!(f_low > 0.0)) f_low = 1e-300;
      int side = 0;
      for (int i = 0; i < 200 && high - low > kEventTime; ++i) {
        double middle =
            i % 3 == 2 ? 0.5 * (low + high) : (low * f_high - high * f_low) / (f_high - f_low);
        middle = std::clamp(middle, low + 0.25 * kEventTime, high - 0.25 * kEventTime);
        slots = slots_;
        tryStep(middle, end, slope, slots);
        const double f = finite(end) ? eventValue(slots_, slots) : -1.0;
        if (f < 0.0) {
          high = middle;
          f_high = f;
          state_high = end;
          slope_high = slope;
          slots_high = slots;
          if (side == -1) f_low *= 0.5;
          side = -1;
        } else {
          low = middle;
          f_low = std::max(f, 1e-300);
          if (side == 1) f_high *= 0.5;
          side = 1;
        }
      }
      const double t_event = time_ + high;
      double& oldest = recent_events_[static_cast<std::size_t>(counts_.events) % kRecentEvents];
      if (t_event - oldest < kCluster) coarse_until_ = t_event + kCoarseSpan;
      oldest = t_event;
      accept(t_event, state_high, slope_high, slots_high);
      ++counts_.events;

      // change the modes of those that asked for it
      bool closed = false;
      for (std::size_t i = 0; i < kSlots; ++i) {
        Slot& slot = slots_[i];
        if (slot.mode == Mode::kApart) {
          if (slot.point.valid && slot.point.gap < 0.0) {
            slot.mode = discreteFriction() ? Mode::kIdle : Mode::kSlip;
            slot.armed = false;
            if (slot.gap_rate < -1e-9) ++counts_.impacts;
            closed = true;
          }
        } else if (!slot.point.valid || slot.point.gap >= kReach) {
          slot.mode = Mode::kApart;
        }
      }
      if (closed && rigid()) impact();
      decide();
      if (counts_.events > kEventLimit) {
        stop_ = StopReason::kEventLimit;
        return stop_;
      }
    }
    if (std::sin(state_.q(4)) < 0.1) {
      stop_ = StopReason::kSingular;
      return stop_;
    }
    // the lowest point on the plane ends a run that excludes this contact
    if (contacts_matter && !scenario_.contact.features.edge_plane) {
      const Slot& plane = slots_[2];
      if (plane.mode != Mode::kApart && plane.point.valid) {
        stop_ = StopReason::kEdgePlane;
        return stop_;
      }
    }
  }
  return stop_;
}

const std::array<ContactReport, kSlots>& Simulation::contacts() {
  refresh();
  for (std::size_t i = 0; i < kSlots; ++i) {
    const Slot& slot = slots_[i];
    ContactReport& r = report_[i];
    r.feature = i < 2 ? ContactReport::kEdgeEdge : ContactReport::kEdgePlane;
    r.valid = slot.point.valid;
    const bool carries = slot.mode != Mode::kApart && slot.normal_force > 0.0;
    const bool rests = discreteFriction()
                           ? slot.mode == Mode::kStick
                           : slot.tangential.norm() <= scenario_.contact.regularisation_speed;
    r.state = !carries ? ContactReport::kOpen
              : rests  ? ContactReport::kStick
                       : ContactReport::kSlip;
    if (!r.valid) {
      r.force.setZero();
      r.gap = 0.0;
      continue;
    }
    r.point = fromThesisAxes(slot.point.p);
    r.normal = fromThesisAxes(slot.point.normal);
    r.force = carries ? fromThesisAxes(slot.force) : Vec3(Vec3::Zero());
    r.gap = slot.point.gap;
  }
  return report_;
}

Vector6 Simulation::couplingWrench() {
  refresh();
  const Kinematics k = kinematics(state_);
  Mat3 inverse_transposed = k.Re.transpose().inverse();
  const Vec3 force = motion_.FK + motion_.FC;
  const Vec3 moment =
      inverse_transposed * Vec3(motion_.FKm(2), motion_.FKm(1), motion_.FKm(0)) + motion_.FCm;
  // about the rest point, in the carrier's axes
  const Vec3 about_rest = moment + motion_.deflection.head<3>().cross(force);
  const Mat3 R_CH = carrierPose().R.transpose();
  Vector6 w;
  w << R_CH * fromThesisAxes(force), R_CH * fromThesisAxes(about_rest);
  return w;
}

Vector6 Simulation::couplingDeflection() {
  refresh();
  const Mat3 R_CH = carrierPose().R.transpose();
  Vector6 d;
  d << R_CH * fromThesisAxes(motion_.deflection.head<3>()),
      vectorFromRotation(R_CH * pegPose().R).value;
  return d;
}

Vector6 Simulation::holeWrench() {
  refresh();
  Vector6 w = Vector6::Zero();
  for (const Slot& slot : slots_) {
    if (slot.mode == Mode::kApart || !slot.point.valid) continue;
    const Vec3 force = -fromThesisAxes(slot.force);
    w.head<3>() += force;
    w.tail<3>() += fromThesisAxes(slot.point.p).cross(force);
  }
  return w;
}

Pose Simulation::pegPose() const {
  const Kinematics k = kinematics(state_);
  Pose X;
  X.R.col(0) = fromThesisAxes(k.R1);
  X.R.col(1) = -fromThesisAxes(k.R0);
  X.R.col(2) = fromThesisAxes(k.a);
  X.p = fromThesisAxes(k.x - scenario_.peg.half_height * k.a);
  return X;
}

Pose Simulation::carrierPose() const {
  const Vector6 rest = restAt(time_).position;
  Pose X;
  X.R = rotationFromEuler({rest(5), rest(4), state_.q(8)});
  X.p = Vec3(state_.q(6), state_.q(7), rest(2));
  return X;
}

double Simulation::energy() const { return mechanicalEnergy(scenario_, state_, restAt(time_)); }

}  // namespace assembly_cell
