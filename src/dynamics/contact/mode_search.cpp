// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "mode_search.h"

#include <algorithm>

#include "contact_solver.h"
#include "contact_tolerances.h"
#include "rest_forces.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr int kModePasses = 24, kSlipTurns = 100;
// Maximum number of points for enumeration, 3^3 combinations.
constexpr int kMaxEnumerated = 3;
// Iterations within which the error of directions must halve; a face of which one point would stick
// does not converge.
constexpr int kProgress = 10;
// An iteration that reverses the last one by more than this fraction is damped, by at most
// kMaxStiffer. Half and twice of the second, half of the first: forces of 20 alignments agree
// within 2e-5 N; twice of the first: the iteration oscillates.
constexpr double kSwing = 0.5, kMaxStiffer = 4.0;
// A secant step is at most ten times the fixed-point step.
constexpr double kFall = 0.1;

// Sets the hysteresis from the accelerations at this state. Returns the limit of decisions: half
// the smaller of the old and the new one, so that the violation that caused the event exceeds it.
double setHysteresis(const System& s, Context& c, const Evaluation& e) {
  double scale = kMinScale;
  for (const std::size_t i : Slots(e.active())) {
    const ContactKinematics& at = e.contacts[i];
    scale = std::max(
        scale, std::abs(e.point(i).normal.dot(at.acceleration)) + std::abs(at.rates.gap_bias));
  }
  const double change = kHysteresis * s.coarseness * scale;
  const double limit = 0.5 * (c.approach > 0.0 ? std::min(c.approach, change) : change);
  c.approach = change;
  c.pull = c.approach * s.scenario.mechanism.peg.mass;
  return limit;
}

// Friction of a contact [N].
Vec3 tangentialForce(const Evaluation& e, std::size_t i) {
  const ContactKinematics& at = e.contacts[i];
  const Vec3 tangential = at.force - at.normal_force * e.point(i).normal;
  const double size = tangential.norm();
  return size > 0.0 ? Vec3(tangential / size) : Vec3(Vec3::Zero());
}

// Makes an idle contact carry: stick or slip. `again`: it did so at this decision and pulled; it
// slips then, as stick requires friction before it has a load.
void join(const System& s, std::size_t i, bool again, Context& c, const Evaluation& e) {
  Slot& slot = c.slots[i];
  slot.mode = slot.armed ? Mode::kSlip : Mode::kStick;
  if (!again || slot.armed) return;
  const Vec3& normal = e.point(i).normal;
  Vec3 acceleration = accelerationOf(bodyOf(s, e.k), e, i);
  acceleration -= normal * normal.dot(acceleration);
  const double size = acceleration.norm();
  if (!(size > 0.0)) return;
  slot.mode = Mode::kSlip;
  slot.slip_direction = acceleration / -size;
}

// Changes the mode of the contact with the largest violation: pulling, else outside its cone, else
// (while `joining`) idle and approaching. False if there is none. joined: contacts that began to
// carry at this decision.
bool changeWorst(const System& s, double limit, bool joining, ContactSlotMask& joined, Context& c,
                 const Evaluation& e) {
  std::size_t worst = kSlots;
  Mode change = Mode::kIdle;
  double excess = limit * s.scenario.mechanism.peg.mass;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode == Mode::kIdle || !(e.contacts[i].normal_force < -excess)) continue;
    excess = -e.contacts[i].normal_force;
    worst = i;
  }
  if (worst == kSlots) {
    for (const std::size_t i : Slots(e.active())) {
      if (c.slots[i].mode != Mode::kStick) continue;
      const double over = coneExcess(s, e, i);
      if (!(over > excess)) continue;
      excess = over;
      worst = i;
      change = Mode::kSlip;
    }
  }
  if (worst == kSlots && joining) {
    excess = limit;
    for (const std::size_t i : Slots(e.active())) {
      if (c.slots[i].mode != Mode::kIdle || !(e.contacts[i].demand < -excess)) continue;
      excess = -e.contacts[i].demand;
      worst = i;
    }
    if (worst == kSlots) return false;
    join(s, worst, (joined >> worst & 1u) != 0, c, e);
    joined |= 1u << worst;
    return true;
  }
  if (worst == kSlots) return false;
  // the points of a face begin to slip together
  ContactSlotMask changed = 1u << worst;
  if (change == Mode::kSlip && (changed & e.face)) changed = e.active() & e.face;
  for (const std::size_t i : Slots(changed)) {
    Slot& slot = c.slots[i];
    if (i != worst && slot.mode != Mode::kStick) continue;
    if (change == Mode::kSlip && !slot.armed) slot.slip_direction = tangentialForce(e, i);
    slot.mode = change;
  }
  return true;
}

// Iteration of the direction of slip of one point.
struct Turning {
  Vec3 asked = Vec3::Zero(), last = Vec3::Zero();  // fixed-point steps and steps taken
  double stiffer = 1.0;

  // Next step, from the fixed-point step `step`: secant steps of a single point while the
  // fixed-point steps decrease; else the fixed-point step, damped after a reversal.
  Vec3 next(const Vec3& step, bool alone) {
    const double square = last.squaredNorm(), fall = (asked - step).dot(last);
    const bool secant = alone && step.squaredNorm() < asked.squaredNorm() && fall > kFall * square;
    const double swing = -step.dot(last);
    if (!secant && swing > kSwing * square) {
      stiffer *= std::min(1.0 + swing / square, kMaxStiffer);
    }
    asked = step;
    last = secant ? Vec3(square / fall * step) : step;
    return last;
  }
};

// Fixed-point (prox) iteration for the direction of beginning slip: along the acceleration of the
// point, which depends on the friction opposite to it; opposite to the friction if that still holds
// the point. Steps are scaled by the inverse mass along the direction; without damping they would
// oscillate if the one across is more than twice as large.
void findSlip(const System& s, Context& c, Evaluation& e) {
  const double mu = s.scenario.mechanism.friction.sliding_coefficient;
  ContactSlotMask begins = 0;
  for (const std::size_t i : Slots(e.active())) {
    if (c.slots[i].mode == Mode::kSlip && !c.slots[i].armed) begins |= 1u << i;
  }
  if (mu == 0.0 || !begins) return;
  const bool alone = (begins & (begins - 1)) == 0;
  std::array<Turning, kSlots> turning;
  const Body body = bodyOf(s, e.k);
  double before = HUGE_VAL;
  for (int turn = 0; turn < kSlipTurns; ++turn) {
    double largest = 0.0;
    for (const std::size_t i : Slots(begins)) {
      Vec3& direction = c.slots[i].slip_direction;
      const Vec3& normal = e.point(i).normal;
      const ContactKinematics& at = e.contacts[i];
      Vec3 acceleration = accelerationOf(body, e, i);
      acceleration -= normal * normal.dot(acceleration);
      const Vec3 tangent = direction - normal * normal.dot(direction);
      const double compliance = turning[i].stiffer * mu * at.normal_force *
                                tangent.dot(response(body, at.r, at.r, tangent));
      const Vec3 next = tangent - acceleration / compliance;
      const double size = next.norm();
      if (!(compliance > 0.0) || !(size > 0.0) || !std::isfinite(size)) continue;
      const Vec3 change = turning[i].next(next / size - direction, alone);
      largest = std::max(largest, change.norm());
      direction = (direction + change).normalized();
    }
    if (largest < 1e-14) return;
    c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
    if (largest < 1e-12) return;
    if (turn % kProgress < kProgress - 1) continue;
    if (largest > 0.5 * before) return;
    before = largest;
  }
}

}  // namespace

double worstViolation(const System& s, const Context& c, const Evaluation& e) {
  double maximum = 0.0;
  for (const std::size_t i : Slots(e.active())) {
    const ContactKinematics& at = e.contacts[i];
    const bool idle = c.slots[i].mode == Mode::kIdle;
    maximum =
        std::max(maximum, idle ? -at.demand * s.scenario.mechanism.peg.mass : -at.normal_force);
    if (c.slots[i].mode == Mode::kStick) maximum = std::max(maximum, coneExcess(s, e, i));
  }
  return maximum;
}

// Reverted if it makes a face pull that did not: near its centre of rotation the directions of its
// points differ arbitrarily.
void solveSlipDirections(const System& s, double limit, Context& c, Evaluation& e) {
  if (!(e.active() & e.face)) return findSlip(s, c, e);
  const double allowed = limit * s.scenario.mechanism.peg.mass;
  const bool agreed = worstViolation(s, c, e) <= allowed;
  const SlotArray before = c.slots;
  findSlip(s, c, e);
  if (!agreed || worstViolation(s, c, e) <= allowed) return;
  c.slots = before;
  c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
}

void iterateModes(const System& s, bool first, double& limit, Context& c, Evaluation& e) {
  if (!s.discrete_friction) {
    c.slope = chooseCarriers(s, c.slots, e);
    return;
  }
  ContactSlotMask joined = 0;
  for (const std::size_t i : Slots(e.active())) c.slots[i].rest_force.setZero();
  for (int pass = 0; pass < kModePasses; ++pass) {
    c.slope = pass == 0 ? contactForces(s, c.slots, Level::kEvents, e)
                        : recomputeForces(s, c.slots, Level::kEvents, e);
    if (first && pass == 0) limit = setHysteresis(s, c, e);
    if (pass == 0 && findAdmissibleRestForces(s, limit, c, e)) break;
    if (!changeWorst(s, limit, pass < kModePasses / 2, joined, c, e)) break;
  }
}

void enumerateModes(const System& s, double limit, Context& c, Evaluation& e) {
  const ContactSlotMask points = e.active();
  const double allowed = limit * s.scenario.mechanism.peg.mass;
  double minimum = worstViolation(s, c, e);
  if (!(minimum > allowed) || __builtin_popcount(points) > kMaxEnumerated || (points & e.face))
    return;
  SlotArray best = c.slots;
  ContactSlotMask armed = 0;
  for (const std::size_t i : Slots(points)) armed |= c.slots[i].armed ? 1u << i : 0u;
  // subsets of carrying points, from all to none; for each the subsets that slip
  for (ContactSlotMask carry = points;; carry = (carry - 1) & points) {
    for (const std::size_t i : Slots(points)) {
      const ContactSlotMask bit = 1u << i;
      c.slots[i].mode = !(carry & bit) ? Mode::kIdle : armed & bit ? Mode::kSlip : Mode::kStick;
    }
    recomputeForces(s, c.slots, Level::kEvents, e);
    SlotArray held = c.slots;
    for (const std::size_t i : Slots(carry & ~armed))
      held[i].slip_direction = tangentialForce(e, i);
    for (ContactSlotMask slide = 0;;) {
      c.slots = held;
      for (const std::size_t i : Slots(slide)) c.slots[i].mode = Mode::kSlip;
      c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
      findSlip(s, c, e);
      const double by = worstViolation(s, c, e);
      if (by < minimum) {
        minimum = by;
        best = c.slots;
      }
      slide = (slide - (carry & ~armed)) & carry & ~armed;
      if (slide == 0 || !(minimum > allowed)) break;
    }
    if (carry == 0 || !(minimum > allowed)) break;
  }
  c.slots = best;
  c.slope = recomputeForces(s, c.slots, Level::kEvents, e);
}

}  // namespace assembly_cell
