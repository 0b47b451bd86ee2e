// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/free_peg.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Lengths and forces of the default cell; PressLimits::scale carries them over.
constexpr double kPullStep = 2.5e-4;  // of travel on the path out [m]
constexpr double kPullTravel = 2e-3;  // in such steps [m]
// Of a coupling that is twice as stiff as the default one it may take as much force: 16 N, less
// than half of the limit. Stiffer ones are pulled in smaller steps.
constexpr double kPullSofter = 2.0;
// A peg held against a quarter of the force limit is wedged. Half: the peg is turned where it would
// have come free anyway. Twice: 20 N have tightened the wedge, and it takes twice the torque.
constexpr double kWedged = 0.25;
// Turned by so much about its axis the coupling makes 3 N m: more than friction of 200 N on both
// sides of a peg of 25 mm. Half: wedges of 100 N. Twice: a longer motion.
constexpr double kTwist = 0.06;    // [rad]
constexpr double kTwisted = 0.01;  // of it, which yields
// A peg that is turned in a wedge strains the coupling by the way of its end. In steps of kPullStep
// it stops below the force limit; 0.05 rad at once reached 190 N.
constexpr double kTurned = 0.5;  // of the force limit: the wedge doesn't turn any farther
constexpr double kPulled = 0.8;  // of the force limit, which a step more would reach
constexpr int kFreeSteps = 4, kMaxFreeSteps = 100;  // of kPullStep: a millimetre, and 25
constexpr double kLifts = 3e-3;     // travel of some tareFreePeg(), up and aside [m], tilt [rad]
constexpr double kLifted = 1e-4;    // of a millimetre up, what may be missing [m]
constexpr double kFreeSide = 3e-4;  // against a wall 2 N [m]
// Of the force over a step of a free peg [N]. Contact changes it by the coupling's stiffness times
// the step, 12 N; noise of 20 mV a channel, forty times the cell's, by 0.12 N rms. Half: a peg
// with such noise is lifted farther. Twice: a contact softer by a factor of 12 is a free peg.
constexpr double kFreeChange = 0.5;
// Noise beyond so many times that leaves no six steps in a row without a change, however free: of
// its largest changes, so one step in seven passes.
constexpr double kNoisy = 4.0;

// About the peg's axis to both sides, until it comes free: friction that has to hold it against the
// rotation doesn't hold it against a pull.
void twist(GuardedCarrier& carrier, const RestPose& at) {
  const Pose X = poseFromRest(at);
  const ContactSensor& sensor = carrier.sensor();
  for (const double angle : {kTwist, -kTwist, 0.0}) {
    const Pose turned{X.R * rotationFromVector({Eigen::Vector3d(0, 0, angle)}), X.p};
    PlantCommand command;
    command.rest = restFromPose(turned);
    const double yaw = command.rest->yaw;
    bool there = false;
    for (int i = 0;
         !there && i < kMotionBlocks && (angle == 0.0 || sensor.heldForce() > sensor.touchForce());
         ++i) {
      carrier.step(command);
      command.rest.reset();
      there = std::abs(carrier.last().carrier.yaw - yaw) < kTwisted;
    }
  }
}

// Of a step on the path out, see kPullSofter [m].
double pullStep(const PressLimits& limits) {
  return kPullStep * std::min(1.0, limits.scale.sink / limits.scale.force * kPullSofter);
}

// As far as the wedge lets it be turned or moved. Returns where that ended.
RestPose turn(GuardedCarrier& carrier, const RestPose& from, const RestPose& to) {
  const double angle = std::hypot(to.yaw - from.yaw, to.theta - from.theta, to.phi - from.phi);
  const double way = Eigen::Vector3d(to.x - from.x, to.y - from.y, to.z - from.z).norm();
  const int steps =
      static_cast<int>(std::ceil((way + kTurnArm * angle) / pullStep(carrier.limits())));
  RestPose at = from;
  for (int i = 1; i <= steps && carrier.sensor().heldForce() < kTurned * carrier.limits().force;
       ++i) {
    const double done = static_cast<double>(i) / steps;
    const auto between = [done](double a, double b) { return a + done * (b - a); };
    at = {between(from.x, to.x),     between(from.y, to.y),         between(from.z, to.z),
          between(from.yaw, to.yaw), between(from.theta, to.theta), between(from.phi, to.phi)};
    carrier.moveTo(at);
  }
  return at;
}

// From where tareFreePeg() has lifted it, in this goal and the failed one. In contact there, it
// hung free only by assumption.
void goBack(GuardedCarrier& carrier, const RestPose& hung, const Mechanism& mechanism) {
  const RestPose& at = carrier.last().carrier;
  const double up = at.z - hung.z, turned = std::hypot(at.theta - hung.theta, at.phi - hung.phi);
  const bool there = std::hypot(at.x - hung.x, at.y - hung.y) < kLifts && turned < kLifts;
  if (!there || up < kHeightNoise || up > kLifts) return;
  carrier.moveTo(hung);
  if (carrier.settle() && carrier.force().norm() < carrier.sensor().freeForce()) return;
  carrier.clearTare();
  tareFreePeg(carrier, mechanism);
}

// The rest of the way up to z, a step a block: an edge that meets the bore once more meets it
// slowly, and is pulled from there.
RestPose climb(GuardedCarrier& carrier, RestPose up, double z) {
  const double step = pullStep(carrier.limits());
  while (up.z < z) {
    if (carrier.sensor().heldForce() > carrier.sensor().touchForce()) {
      up = pullUp(carrier, up, step, z - up.z);
    } else {
      up.z = std::min(up.z + step, z);
      carrier.nudge(up);
    }
  }
  return up;
}

}  // namespace

void tareFreePeg(GuardedCarrier& carrier, const Mechanism& mechanism) {
  const PressLimits& limits = carrier.limits();
  const ContactSensor& sensor = carrier.sensor();
  carrier.tare();
  const PlantBlock& last = carrier.last();
  const Eigen::Vector3d up = poseFromRest(last.carrier).R.transpose() * mechanism.up;
  const Vector6 weight = pegWeight(mechanism.peg, mechanism.gravity, up, last.displacement_b);
  if ((sensor.tare().wrench - weight).head<3>().norm() < sensor.freeForce()) return;
  // in contact, or the sensor's zero is another one: up until nothing changes any more
  const double free_change = kFreeChange * limits.scale.force;
  if (sensor.noiseChange() > kNoisy * free_change) {
    throw AlignError(AlignFailure::kNotStill,
                     text("sensor_b's own noise changes its force by up to %.1f N from block to "
                          "block, contact shows where %.1f N are something; look at its bridge",
                          sensor.noiseChange(), free_change));
  }
  carrier.setGuarded(false);
  exciterOff(carrier);
  RestPose higher = last.carrier;
  int same = 0;
  for (int i = 0; same < kFreeSteps + 2; ++i) {
    const Vector6 before = last.wrench_b;
    // sideways at the end, along x and y: a peg slides up along a wall without a change
    RestPose next = higher;
    if (same < kFreeSteps) next.z = higher.z += kPullStep;
    const double side = kFreeSide * std::max(limits.scale.give, limits.scale.length);
    if (same >= kFreeSteps) next.x += side;
    if (same > kFreeSteps) next.y += side;
    carrier.moveTo(next);
    if (i == kMaxFreeSteps || !carrier.settle() || carrier.force().norm() > 2 * limits.force) {
      throw AlignError(
          AlignFailure::kInContact,
          text("the peg doesn't come free: %.1f N of change after %.1f mm of travel up; take it "
               "out by the action retreat or by hand, or reset the simulation",
               carrier.force().norm(), (higher.z - sensor.tare().pose.z) * 1e3));
    }
    const double change = (last.wrench_b - before).head<3>().norm();
    same = change < free_change ? same + 1 : 0;
  }
  carrier.setGuarded(true);
  carrier.clearTare();
  carrier.tare();
}

void releasePeg(GuardedCarrier& carrier, const Mechanism& mechanism,
                const std::optional<RestPose>& hung) {
  carrier.setGuarded(false);
  exciterOff(carrier);
  const bool low = !hung || carrier.last().carrier.z < hung->z - kHeightNoise;
  if (low) {
    RestPose up = carrier.last().carrier;
    up.z += kFreeSteps * kPullStep;
    carrier.nudge(up);
    // about there is enough: the scatter of the reported pose is not known before the tare
    for (int i = 0; i < kMotionBlocks && std::abs(carrier.last().carrier.z - up.z) > kLifted; ++i) {
      carrier.wait(1);
    }
  }
  carrier.setGuarded(true);
  tareFreePeg(carrier, mechanism);
  if (!low) goBack(carrier, *hung, mechanism);
}

// Gently, for a wedge only tightens when it is pulled.
RestPose pullUp(GuardedCarrier& carrier, const RestPose& from, double min_travel,
                double max_travel) {
  const PressLimits& limits = carrier.limits();
  const ContactSensor& sensor = carrier.sensor();
  const double step = pullStep(limits);
  RestPose up = from;
  for (double pulled = 0.0;
       pulled < min_travel - 0.5 * step ||
       (pulled < max_travel - 0.5 * step && sensor.heldForce() > sensor.touchForce());
       pulled += step) {
    up.z += step;
    carrier.moveTo(up);
    if (sensor.heldForce() > kWedged * limits.force) twist(carrier, up);
    if (sensor.heldForce() > kPulled * limits.force) {
      throw AlignError(AlignFailure::kStuck, "the peg doesn't come free");
    }
  }
  return up;
}

void retreatUp(GuardedCarrier& carrier, const RestPose& relaxed, const RestPose& turned,
               double travel) {
  carrier.setGuarded(false);
  exciterOff(carrier);
  carrier.moveTo(relaxed);
  const RestPose from = turn(carrier, relaxed, turned);
  // a soft coupling hardly pulls over so short a travel: on until the peg is free or held by the
  // limit
  const double end = std::max(travel, kPullTravel);
  carrier.moveTo(climb(carrier, pullUp(carrier, from, kPullTravel, end), from.z + end));
  if (!carrier.settle()) throw AlignError(AlignFailure::kStuck, "the peg doesn't come free");
  carrier.setGuarded(true);
  const ContactSensor& sensor = carrier.sensor();
  const double shift = sensor.heldForce();
  if (shift > sensor.freeShift()) {
    throw AlignError(
        AlignFailure::kZeroShifted,
        text("%.2f N with the peg free, %.2f N are allowed", shift, sensor.freeShift()));
  }
}

}  // namespace assembly_cell
