// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "contact_solver.h"

#include <algorithm>

#include "assembly_cell/math/roots.h"
#include "contact_tolerances.h"
#include "face/face_edge.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Tilt below which the rates of a rigid peg's lowest point are set to zero, as it moves around the
// edge at unbounded speed. Half and twice: 13 and 15 of 400 random scenes end elsewhere, effort
// within 2 %.
constexpr double kFlat = 1e-5;  // [rad]
// Of a rotating face, slip speed over that of the fastest point below which friction is reduced:
// the real load is distributed around the centre of rotation, where a single point would stick.
// Half and twice: 16 and 22 of 181 level random scenes end elsewhere, effort +6 % and −2 %.
constexpr double kCentre = 0.25;
// Minimum fraction of the load of a point of a face, above the rounding of forces.
constexpr double kMinLoadFraction = 1e-12;
constexpr int kShares = 2;  // sweeps over the pairs of more than two sticking points

// Accelerations of the active contacts without contact forces; false if there is none.
bool prepare(const System& s, Evaluation& e) {
  const Kinematics& k = e.k;
  const Vec3 angular = k.Re * e.free.segment<3>(3) + k.Re_rate * e.euler_rates;
  e.wedge_margin = 1.0;
  for (const std::size_t i : Slots(e.closed)) {
    ContactKinematics& at = e.contacts[i];
    at.normal_force = 0.0;
    at.force.setZero();
    if (!e.valid(i)) continue;
    at.acceleration = e.free.head<3>() + angular.cross(at.r);
    at.rates = {};
    if (s.scenario.thesis.no_centripetal) continue;
    at.acceleration += k.omega.cross(k.omega.cross(at.r));
    // no motion along the edge of a rigid flat peg's lowest point and of the points of a face
    const bool flat = s.rigid && e.point(i).feature == ContactFeature::kEdgePlane &&
                      k.a(1) * k.a(1) + k.a(2) * k.a(2) < kFlat * kFlat &&
                      !canRestOnFace(s, e.edge);
    if (flat || e.face >> i & 1u) continue;
    const EdgeCircle edge =
        kShoulderSlots >> i & 1u ? shoulderOf(e.edge, s.shapes.peg_chamfer) : e.edge;
    at.rates = contactRates(edge, e.point(i), at.velocity, k.omega);
  }
  return e.active() != 0;
}

Vector9 withForces(const System& s, const Evaluation& e) {
  ForceMoment sum;
  for (const std::size_t i : Slots(e.closed)) sum.add(e.contacts[i].r, e.contacts[i].force);
  return e.free + accelerationBy(s, e.k, sum);
}

// Row of a slipping or sticking contact: the prescribed change of its acceleration. min_slip: slip
// speed below which friction is reduced [m/s].
void addRow(const System& s, const Slot& slot, std::size_t i, double min_slip, const Evaluation& e,
            Constraints& constraints) {
  const ContactParameters& law = s.scenario.contact;
  // under the rigid law project() keeps closed gaps at zero instead
  const double rate = s.rigid ? 0.0 : law.rate, pull_back = s.rigid ? 0.0 : law.pull_back;
  const ContactKinematics& at = e.contacts[i];
  const Vec3& normal = e.point(i).normal;
  Constraint& row = constraints.add(i, at.r, normal);
  const double normal_target = -rate * at.gap_rate - pull_back * at.gap - at.rates.gap_bias;
  row.stick = slot.mode == Mode::kStick;
  if (row.stick) {
    // the material point of the peg at the contact rests, also while the contact rolls
    const double creep = s.scenario.thesis.creep ? 0.0 : rate;
    const Vec3 rolling = at.rates.rolling - normal * normal.dot(at.rates.rolling);
    row.change = normal * normal_target - creep * at.tangential - rolling - at.acceleration;
    return;
  }
  // beginning slip has the direction of its limit, then that of the velocity
  const double own = at.tangential.norm(), speed = std::max(own, min_slip);
  const double begin = slot.armed ? 0.0 : std::clamp(2.0 - own / slipThreshold(s, e), 0.0, 1.0);
  Vec3 slip = -begin * slot.slip_direction;
  if (speed > 0.0) slip += (1.0 - begin) / speed * at.tangential;
  const double size = speed > own || (begin == 0.0 && own > 0.0) ? 1.0 : slip.norm();
  const Vec3 friction = size > 0.0 ? Vec3(slip / -size) : slot.slip_direction;
  row.direction = normal + s.scenario.mechanism.friction.sliding_coefficient * friction;
  row.change = (normal_target - normal.dot(at.acceleration)) * normal;
}

// Sets `demand` of an idle slot.
void findDemand(const System& s, const Body& body, const Constraints& rows, std::size_t i,
                Evaluation& e) {
  const ContactParameters& law = s.scenario.contact;
  const double rate = s.rigid ? 0.0 : law.rate, pull_back = s.rigid ? 0.0 : law.pull_back;
  ContactKinematics& at = e.contacts[i];
  Vec3 acceleration = at.acceleration;
  for (const Constraint& row : rows) {
    acceleration += response(body, at.r, row.r, e.contacts[row.slot].force);
  }
  at.demand = e.point(i).normal.dot(acceleration) + at.rates.gap_bias + rate * at.gap_rate +
              pull_back * at.gap;
}

// Distributes the friction of the sticking points of a face in proportion to their loads, where it
// is undetermined: then it is as far inside the cones as possible, and all points of a face that is
// pushed begin to slip together.
void shareFaceFriction(ContactSlotMask points, Evaluation& e) {
  const auto planar = [](const Vec3& v) { return v.tail<2>(); };
  const auto moment = [](const Eigen::Vector2d& arm, const Eigen::Vector2d& force) {
    return arm(0) * force(1) - arm(1) * force(0);
  };
  std::array<double, kSlots> share{};
  double load = 0.0, turning = 0.0, inertia = 0.0;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero(), total = Eigen::Vector2d::Zero();
  for (const std::size_t i : Slots(points)) load += std::abs(e.contacts[i].normal_force);
  const double minimum = kMinLoadFraction * load;
  if (!(minimum > 0.0)) return;
  load = 0.0;
  for (const std::size_t i : Slots(points)) {
    const ContactKinematics& at = e.contacts[i];
    share[i] = std::max(at.normal_force, minimum);
    load += share[i];
    middle += share[i] * planar(at.r);
    total += planar(at.force);
  }
  middle /= load;
  for (const std::size_t i : Slots(points)) {
    const Eigen::Vector2d arm = planar(e.contacts[i].r) - middle;
    turning += moment(arm, planar(e.contacts[i].force));
    inertia += share[i] * arm.squaredNorm();
  }
  const double turn = inertia > 0.0 ? turning / inertia : 0.0;
  for (const std::size_t i : Slots(points)) {
    const Eigen::Vector2d arm = planar(e.contacts[i].r) - middle;
    e.contacts[i].force.tail<2>() =
        share[i] * (total / load + turn * Eigen::Vector2d(-arm(1), arm(0)));
  }
}

// Subtracts the effect of known rest forces from the right-hand sides. False if there are none.
bool addRestForces(const Body& body, const SlotArray& slots, Constraints& rows) {
  ForceMoment sum;
  bool any = false;
  for (const Constraint& row : rows) {
    const Vec3& force = slots[row.slot].rest_force;
    any = any || force != Vec3::Zero();
    sum.add(row.r, force);
  }
  if (!any) return false;
  const Vec3 angular = body.inverse_inertia * sum.moment;
  for (Constraint& row : rows) row.change -= sum.force / body.mass + angular.cross(row.r);
  return true;
}

void solveModes(const System& s, const SlotArray& slots, Level level, Evaluation& e) {
  const Body body = bodyOf(s, e.k);
  Constraints constraints;
  ContactSlotMask sticking = 0, idle = 0;
  const ContactSlotMask face = e.active() & e.face;
  const double minimum = face ? kCentre * slipSpeed(e, *Slots(face)) : 0.0;
  for (const std::size_t i : Slots(e.active())) {
    if (slots[i].mode == Mode::kIdle) {
      idle |= 1u << i;
      e.contacts[i].force.setZero();
      e.contacts[i].normal_force = 0.0;
      continue;
    }
    addRow(s, slots[i], i, face >> i & 1u ? minimum : 0.0, e, constraints);
    if (slots[i].mode == Mode::kStick) sticking |= 1u << i;
  }
  const bool held = level == Level::kEvents && addRestForces(body, slots, constraints);
  const bool free = solveConstraints(body, constraints);
  for (const Constraint& row : constraints) {
    ContactKinematics& at = e.contacts[row.slot];
    at.force = row.force;
    if (held) at.force += slots[row.slot].rest_force;
    at.normal_force = row.normal.dot(at.force);
  }
  if (level == Level::kForces) return;
  if (!s.rigid && !free && slips(slots)) e.wedge_margin = wedgeMargin(body, constraints);

  const ContactSlotMask resting = sticking & face;
  if (!held && (resting & (resting - 1))) shareFaceFriction(resting, e);
  // internal forces of sticking points don't move the peg: any value inside all cones is valid, and
  // they are optimised only if the minimum-norm solution is outside
  if ((sticking & (sticking - 1)) && (sticking & ~e.face) && !insideCones(s, e, sticking, 0.0)) {
    shareInternalForces(s, sticking, e.loads, e);
  }
  for (const std::size_t i : Slots(idle)) findDemand(s, body, constraints, i, e);
}

// The internal force along the connection of two sticking points is undetermined: takes the value
// in ±limit [N] that is farthest inside both friction cones.
void shareInternalForce(const System& s, std::size_t one, std::size_t two, double limit,
                        Evaluation& e) {
  const Vec3 apart = e.contacts[two].r - e.contacts[one].r;
  const double distance = apart.norm();
  if (!(distance > 0.0)) return;
  const Vec3 along = apart / distance;
  const double mu = s.scenario.mechanism.friction.static_coefficient;
  // for an internal force s: tangential force² (T + s t)² and normal force N + s n of each point
  struct Cone {
    double tt, ts, ss, N, n;
  };
  const auto cone = [&](std::size_t i, const Vec3& direction) {
    const Vec3& normal = e.point(i).normal;
    const Vec3 T = e.contacts[i].force - e.contacts[i].normal_force * normal;
    const double n = normal.dot(direction);
    const Vec3 t = direction - n * normal;
    return Cone{T.squaredNorm(), 2.0 * T.dot(t), t.squaredNorm(), e.contacts[i].normal_force, n};
  };
  const Cone c1 = cone(one, along), c2 = cone(two, -along);
  const auto outside = [mu](const Cone& c, double x) {
    return std::sqrt(std::max(0.0, c.tt + x * (c.ts + x * c.ss))) - mu * (c.N + x * c.n);
  };
  const auto worse = [&](double x) { return std::max(outside(c1, x), outside(c2, x)); };
  const double x = leastIn(-limit, limit, worse);  // convex in the force
  e.contacts[one].force += x * along;
  e.contacts[two].force -= x * along;
  e.contacts[one].normal_force += x * c1.n;
  e.contacts[two].normal_force += x * c2.n;
}

}  // namespace

Vector9 contactForces(const System& s, const SlotArray& slots, Level level, Evaluation& e) {
  if (!prepare(s, e)) return e.free;
  return recomputeForces(s, slots, level, e);
}

Vector9 recomputeForces(const System& s, const SlotArray& slots, Level level, Evaluation& e) {
  e.wedge_margin = 1.0;
  if (s.discrete_friction) {
    solveModes(s, slots, level, e);
  } else {
    ContactSlotMask carriers = 0;
    for (const std::size_t i : Slots(e.active())) {
      if (slots[i].mode == Mode::kSlip) carriers |= 1u << i;
    }
    regularisedForces(s, slots, carriers, e);
  }
  return withForces(s, e);
}

Vector9 chooseCarriers(const System& s, SlotArray& slots, Evaluation& e) {
  if (!prepare(s, e)) return e.free;
  for (const std::size_t i : Slots(e.active())) {
    slots[i].armed = e.contacts[i].tangential.norm() > s.scenario.contact.regularisation_speed;
  }
  const ContactSlotMask carriers = regularisedForces(s, slots, kUndecided, e);
  for (const std::size_t i : Slots(e.active())) {
    slots[i].mode = carriers >> i & 1u ? Mode::kSlip : Mode::kIdle;
  }
  return withForces(s, e);
}

Vec3 accelerationOf(const Body& body, const Evaluation& e, std::size_t i) {
  const ContactKinematics& at = e.contacts[i];
  Vec3 acceleration = at.acceleration + at.rates.rolling;
  for (const std::size_t j : Slots(e.closed)) {
    acceleration += response(body, at.r, e.contacts[j].r, e.contacts[j].force);
  }
  return acceleration;
}

double slipSpeed(const Evaluation& e, std::size_t i) {
  double fastest = e.contacts[i].tangential.norm();
  if (!(e.face >> i & 1u)) return fastest;
  for (const std::size_t j : Slots(e.active() & e.face)) {
    fastest = std::max(fastest, e.contacts[j].tangential.norm());
  }
  return fastest;
}

bool slips(const SlotArray& slots) {
  return std::any_of(slots.begin(), slots.end(),
                     [](const Slot& slot) { return slot.mode == Mode::kSlip && slot.armed; });
}

double coneExcess(const System& s, const Evaluation& e, std::size_t i) {
  const ContactKinematics& at = e.contacts[i];
  const Vec3 tangential = at.force - at.normal_force * e.point(i).normal;
  return tangential.norm() - s.scenario.mechanism.friction.static_coefficient * at.normal_force;
}

bool insideCones(const System& s, const Evaluation& e, ContactSlotMask points, double by) {
  for (const std::size_t i : Slots(points)) {
    if (coneExcess(s, e, i) > by) return false;
  }
  return true;
}

void shareInternalForces(const System& s, ContactSlotMask points, double limit, Evaluation& e) {
  double load = 0.0;
  for (const std::size_t i : Slots(points)) load += e.contacts[i].force.norm();
  const bool pair = __builtin_popcount(points) < 3;
  for (int round = 0; round < (pair ? 1 : kShares); ++round) {
    for (ContactSlotMask left = points; left; left &= left - 1) {
      for (const std::size_t second : Slots(left & (left - 1))) {
        shareInternalForce(s, *Slots(left), second, limit * load, e);
        if (!pair && insideCones(s, e, points, 0.0)) return;
      }
    }
  }
}

}  // namespace assembly_cell
