// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "slow_slip.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "contact_solver.h"
#include "contact_tolerances.h"
#include "integration/tableaus.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
using Ark = Ark436;

// Maximum number of unknowns of the implicit method.
constexpr int kMaxUnknowns = 6;
// Convergence of the directions: a residual below kAligned, or one that stagnates near its
// rounding, which grows as the slip gets slower. Quasi-Newton takes 3 or 4 iterations; more than
// kMaxIterations fail.
constexpr double kAligned = 0.1;     // over the tolerance [rad/m]
constexpr double kRounding = 1e-10;  // [rad]
constexpr int kMaxIterations = 16;
constexpr double kLargestTurn = 0.5;  // of one iteration [rad]
// Slip speeds over the threshold below which a point does not slip yet, and below which the slip
// has no direction of its own. Half and twice: a vibrated press is the same to the last bit.
constexpr double kNone = 0.01, kHas = 0.5;
// Slip that decreases at a higher rate does not begin.
constexpr double kFading = 1e4;  // [1/s]
// Minimum cosine of the angle between the acceleration and the direction opposite to slip for slip
// to count as decreasing. At smaller ones, steps of up to five times the bound are possible.
constexpr double kDecreasing = 0.5;
// Factor on the error estimate, whose order is one less than that of dopri5; results are then as
// near to those at fine tolerances. Half and twice: effort −8 % and +14 %; half: a face that rocks
// over the hole has 264 events instead of 119.
constexpr double kSafety = 4.0;
// Error set for a step in which slip ends and begins again: the next one has half its length.
constexpr double kRested = 12.0;
using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxUnknowns, 1>;
using Derivative =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

// Acceleration across the slip by the friction of point i [m/s²].
double frictionRate(std::size_t i, const Evaluation& e, const Body& body) {
  const ContactKinematics& at = e.contacts[i];
  const Vec3 friction = at.force - at.normal_force * e.point(i).normal;
  const double size = friction.norm();
  if (!(size > 0.0)) return 0.0;
  const Vec3 across = e.point(i).normal.cross(friction) / size;
  return size * across.dot(response(body, at.r, at.r, across));
}

// Points with a common slip: a single point, or those of a face, which also rotates about its
// normal. The slip is its magnitude times a unit vector: components along two axes of the contact
// plane and, of a face, the circumferential speed of its edge. Friction depends on the unit vector
// only.
struct SlipGroup {
  std::array<std::size_t, 3> slot{};
  int points = 0;
  bool armed = true;
  double radius = 0.0;                 // of the face; 0 for a point [m]
  double friction = 0.0;               // acceleration by friction [m/s²]
  Vec3 start = Vec3::Zero();           // direction of the first axis
  Vec3 normal, first, second, middle;  // axes and lever at the evaluated state
  Vec3 unit = Vec3::UnitX();           // unit vector of the slip
  std::array<Vec3, 2> across;  // unit vectors across `unit`, along which the unknowns turn it
  double speed = 0.0;          // slip along `unit` at the prescribed velocities

  int unknowns() const { return radius > 0.0 ? 2 : 1; }

  void place(const Evaluation& e) {
    normal = e.point(slot[0]).normal;
    first = (start - normal * normal.dot(start)).normalized();
    second = normal.cross(first);
    middle.setZero();
    for (int k = 0; k < points; ++k) middle += e.contacts[slot[k]].r / points;
  }

  Vec3 at(std::size_t i, const Evaluation& e) const {
    Vec3 v = unit(0) * first + unit(1) * second;
    if (radius > 0.0) v += unit(2) / radius * normal.cross(e.contacts[i].r - middle);
    return v;
  }

  // slip vector at these velocities of the peg, not normalised
  Vec3 of(const Vec3& linear, const Vec3& angular) const {
    const Vec3 v = linear + angular.cross(middle);
    return {v.dot(first), v.dot(second), radius * angular.dot(normal)};
  }

  void turn(const double* by) {
    for (int k = 0; k < unknowns(); ++k) unit += by[k] * across[k];
    unit.normalize();
    turnAxes();
  }

  // transports the axes across the vector with it
  void turnAxes() {
    if (radius > 0.0) {
      across[0] = (across[0] - unit * unit.dot(across[0])).normalized();
      across[1] = unit.cross(across[0]);
    } else {
      across[0] = {-unit(1), unit(0), 0.0};
    }
  }
};

// Quasi-Newton solver for the directions of slip.
class SlipDirections {
 public:
  SlipDirections(const System& s, const Context& c, const Evaluation& e) {
    const Body body = bodyOf(s, e.k);
    ContactSlotMask face = 0;
    for (const std::size_t i : Slots(e.active())) {
      if (c.slots[i].mode != Mode::kSlip) continue;
      if (e.face >> i & 1u) {
        face |= 1u << i;
        continue;
      }
      SlipGroup& slip = slips_[n_++];
      add(i, c, frictionRate(i, e, body), slip);
      slip.start = slipOf(s, i, c, e);
    }
    if (face) addFace(s, c, face, e, body, slips_[n_++]);
    for (int k = 0; k < n_; ++k) {
      slips_[k].turnAxes();
      unknowns_ += slips_[k].unknowns();
    }
    // exact if slip persists and the inverse mass is isotropic
    derivative_ = -Derivative::Identity(unknowns_, unknowns_);
  }

  // v' with friction opposite to the slip at the velocities known + weight v'; false without
  // convergence
  bool solve(const System& s, const Context& c, const Vector9& known, double weight, Vector9& slope,
             Evaluation& e) {
    for (int k = 0; k < n_; ++k) slips_[k].place(e);
    const auto left = [&] {
      slope = forces(s, c, Level::kForces, e);
      return misalignment(known + weight * slope, weight, e);
    };
    Unknowns off = left();
    double before = HUGE_VAL;
    for (int turning = 0; turning < kMaxIterations; ++turning) {
      const double size = off.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
      if (!std::isfinite(size)) return false;
      if (size < kAligned * s.scenario.solver.tolerance) return persists();
      if (size < kRounding && size > 0.5 * before) return persists();
      before = size;
      const Unknowns step =
          (-derivative_.partialPivLu().solve(off)).cwiseMax(-kLargestTurn).cwiseMin(kLargestTurn);
      for (int k = 0, at = 0; k < n_; at += slips_[k++].unknowns()) slips_[k].turn(&step(at));
      const Unknowns next = left();
      derivative_ += (next - off - derivative_ * step) * step.transpose() / step.squaredNorm();
      off = next;
    }
    return false;
  }

  // v' with friction opposite to the directions
  Vector9 forces(const System& s, const Context& c, Level level, Evaluation& e) const {
    for (int k = 0; k < n_; ++k) {
      for (int p = 0; p < slips_[k].points; ++p) {
        const std::size_t i = slips_[k].slot[p];
        e.contacts[i].tangential = slips_[k].at(i, e);
      }
    }
    return recomputeForces(s, c.slots, level, e);
  }

  // an existing slip is slower than `slower`, or has ended, at the solved velocities
  bool rests(double slower) const {
    return std::any_of(slips_.begin(), slips_.begin() + n_, [slower](const SlipGroup& slip) {
      return slip.armed && slip.speed < slower;
    });
  }

 private:
  static Vec3 slipOf(const System& s, std::size_t i, const Context& c, const Evaluation& e) {
    const Vec3& slip = e.contacts[i].tangential;
    const bool has = c.slots[i].armed || slip.norm() > kHas * slipThreshold(s, e);
    return has ? slip : Vec3(-c.slots[i].slip_direction);
  }

  static void add(std::size_t i, const Context& c, double friction, SlipGroup& slip) {
    slip.slot[slip.points++] = i;
    slip.armed = slip.armed && c.slots[i].armed;
    slip.friction += friction;
  }

  static void addFace(const System& s, const Context& c, ContactSlotMask points,
                      const Evaluation& e, const Body& body, SlipGroup& slip) {
    for (const std::size_t i : Slots(points)) add(i, c, frictionRate(i, e, body), slip);
    slip.radius = s.scenario.mechanism.peg.radius;
    slip.start = e.point(slip.slot[0]).normal.unitOrthogonal();
    slip.place(e);
    Vec3 mean = Vec3::Zero();
    double turning = 0.0, square = 0.0;
    for (const std::size_t i : Slots(points)) {
      const Vec3 v = slipOf(s, i, c, e), arm = e.contacts[i].r - slip.middle;
      mean += v / slip.points;
      turning += slip.normal.dot(arm.cross(v));
      square += arm.squaredNorm();
    }
    slip.unit = {mean.dot(slip.first), mean.dot(slip.second), slip.radius * turning / square};
    slip.unit.normalize();
    slip.across[0] = slip.unit.unitOrthogonal();
  }

  // components of the slips at the velocities v across their directions, over the slip or the
  // change of slip by friction: smooth where slip reverses
  Unknowns misalignment(const Vector9& v, double weight, const Evaluation& e) {
    Unknowns off(unknowns_);
    const Vec3 linear = v.head<3>(), angular = e.k.Re * v.segment<3>(3);
    for (int k = 0, at = 0; k < n_; ++k) {
      SlipGroup& slip = slips_[k];
      const Vec3 found = slip.of(linear, angular);
      slip.speed = slip.unit.dot(found);
      const double scale = std::abs(slip.speed) + weight * slip.friction;
      for (int j = 0; j < slip.unknowns(); ++j) off(at++) = slip.across[j].dot(found) / scale;
    }
    return off;
  }

  // no existing slip ends in the step
  bool persists() const {
    return std::none_of(slips_.begin(), slips_.begin() + n_,
                        [](const SlipGroup& slip) { return slip.speed < 0.0 && !slip.armed; });
  }

  std::array<SlipGroup, kMaxUnknowns> slips_;
  int n_ = 0, unknowns_ = 0;
  Derivative derivative_;
};

// Beginning slip of point i increases along its onset; false for the remainder of an earlier slip
// and for slip that ends before it has begun.
bool begins(const System& s, const Context& c, std::size_t i, const Evaluation& e,
            const Body& body) {
  const ContactKinematics& at = e.contacts[i];
  const Vec3& friction = c.slots[i].slip_direction;
  const double speed = at.tangential.norm();
  if (!(speed > kNone * slipThreshold(s, e))) return true;
  if (at.tangential.dot(friction) > 0.0) return false;
  return accelerationOf(body, e, i).dot(friction) < kFading * speed;
}

}  // namespace

double slipTurning(const System& s, const Context& c, const Evaluation& e) {
  const double mu = s.scenario.mechanism.friction.sliding_coefficient;
  if (!s.discrete_friction || mu == 0.0) return 0.0;
  ContactSlotMask sliding = 0;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode == Mode::kSlip) sliding |= 1u << i;
  }
  if (!sliding || __builtin_popcount(sliding) > kMaxUnknowns) return 0.0;
  double fastest = 0.0;
  const Body body = bodyOf(s, e.k);
  for (const std::size_t i : Slots(sliding)) {
    const double speed = slipSpeed(e, i);
    if (!c.slots[i].armed && !begins(s, c, i, e, body)) return 0.0;
    fastest = std::max(fastest, frictionRate(i, e, body) / std::max(speed, slipThreshold(s, e)));
  }
  // near Painlevé's paradox the sensitivity of forces to directions grows by that factor
  return fastest / std::clamp(e.wedge_margin, kWedged, 1.0);
}

double slipFalling(const System& s, const Context& c, const Evaluation& e) {
  double fastest = 0.0;
  if (!s.discrete_friction || s.scenario.mechanism.friction.sliding_coefficient == 0.0) return 0.0;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode != Mode::kSlip || !c.slots[i].armed) continue;
    const Vec3 &slip = e.contacts[i].tangential, &normal = e.point(i).normal;
    const double speed = slip.norm();
    // of a face, its fastest point: others may be near the centre of rotation
    if (speed < slipSpeed(e, i)) continue;
    Vec3 acceleration = accelerationOf(bodyOf(s, e.k), e, i);
    acceleration -= normal * normal.dot(acceleration);
    const double size = acceleration.norm();
    if (-slip.dot(acceleration) > kDecreasing * speed * size)
      fastest = std::max(fastest, size / speed);
  }
  return fastest;
}

void attemptSlowSlip(const System& s, const Context& c, Trial& step, Evaluation& e) {
  const double h = step.h;
  keepNear(c.state, e.near);
  std::array<Vector9, Ark::kStages> velocity, slope;
  std::array<Vec3, Ark::kStages> deflection_rate;
  velocity[0] = c.state.v;
  slope[0] = c.slope;
  deflection_rate[0] = c.carrier_deflection_rate;
  evaluate(s, c, c.time, c.state, Level::kForces, e);
  SlipDirections directions(s, c, e);
  bool rested = false, rests = false;
  for (int i = 1; i < Ark::kStages; ++i) {
    State at = c.state;
    Vector9 known = c.state.v;
    for (int j = 0; j < i; ++j) {
      at.q += h * Ark::a[i][j] * velocity[j];
      at.v += h * Ark::a[i][j] * slope[j];
      at.carrier_deflection += h * Ark::a[i][j] * deflection_rate[j];
      known += h * Ark::implicit[i][j] * slope[j];
    }
    velocity[i] = at.v;
    evaluate(s, c, c.time + Ark::c[i] * h, at, Level::kForces, e);
    deflection_rate[i] = e.motion.carrier_deflection_rate;
    if (!directions.solve(s, c, known, h * Ark::kGamma, slope[i], e)) {
      step.end = c.state;
      step.slope = c.slope;
      step.carrier_deflection_rate = c.carrier_deflection_rate;
      step.error = HUGE_VAL;
      return;
    }
    rested = rested || rests;
    rests = directions.rests(slipThreshold(s, e));
  }
  State error;
  step.end = c.state;
  for (int i = 0; i < Ark::kStages; ++i) {
    step.end.q += h * Ark::b[i] * velocity[i];
    step.end.v += h * Ark::b[i] * slope[i];
    step.end.carrier_deflection += h * Ark::b[i] * deflection_rate[i];
    error.q += h * (Ark::b[i] - Ark::estimate[i]) * velocity[i];
    error.v += h * (Ark::b[i] - Ark::estimate[i]) * slope[i];
    error.carrier_deflection += h * (Ark::b[i] - Ark::estimate[i]) * deflection_rate[i];
  }
  // at the end velocity and direction agree, except where slip has reversed
  evaluate(s, c, c.time + h, step.end, Level::kEvents, e);
  step.carrier_deflection_rate = e.motion.carrier_deflection_rate;
  std::array<Vec3, kSlots> slip;
  for (const std::size_t i : Slots(e.active())) slip[i] = e.contacts[i].tangential;
  step.slope = directions.forces(s, c, Level::kEvents, e);
  for (const std::size_t i : Slots(e.active())) e.contacts[i].tangential = slip[i];
  step.error = kSafety * errorOf(s, error);
  if (rested && !rests) step.error = std::max(step.error, kRested);
}

void followSlip(const System& s, Context& c, const Evaluation& e) {
  for (const std::size_t i : Slots(e.active())) {
    Slot& slot = c.slots[i];
    const double speed = e.contacts[i].tangential.norm();
    if (slot.mode != Mode::kSlip || slot.armed) continue;
    if (!(speed > kNone * slipThreshold(s, e))) continue;
    slot.slip_direction = e.contacts[i].tangential / -speed;
  }
}

}  // namespace assembly_cell
