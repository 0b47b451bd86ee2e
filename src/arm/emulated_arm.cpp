// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/emulated_arm.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr int kSubsteps = 4;        // of a cycle, integration of the joints
constexpr double kStep = 1e-3;      // between the poses of CarrierPoses [s]
constexpr double kMinMove = 2e-4;   // shortest move with a repeatability error of its own [m]
constexpr double kStill = 1e-4;     // joint rate at rest [rad/s]
constexpr double kSettling = 0.05;  // time constant of sag and repeatability error [s]
constexpr double kStamp = 1e-6;     // rounding of stamps [s]

void stop(EmulatedArm& arm, const std::string& why) {
  arm.stopped = true;
  arm.why = why;
  arm.queue.clear();
  arm.target = arm.q;
}

void moveJoints(EmulatedArm& arm, const JointLimits& limits, double dt) {
  const double w = 2.0 * M_PI * arm.parameters.bandwidth;
  for (int i = 0; i < kSubsteps; ++i) {
    const double h = dt / kSubsteps;
    arm.acceleration = w * w * (arm.target - arm.q) - 2.0 * w * arm.rate;
    const JointVector before = arm.rate;
    arm.rate = (arm.rate + h * arm.acceleration).cwiseMax(-limits.speed).cwiseMin(limits.speed);
    arm.acceleration = (arm.rate - before) / h;
    arm.q += h * arm.rate;
    const JointVector clamped = arm.q.cwiseMax(limits.lower).cwiseMin(limits.upper);
    if (clamped != arm.q) arm.rate.setZero();
    arm.q = clamped;
  }
}

Pose byJoints(const EmulatedArm& arm, const ArmKinematics& kinematics) {
  return arm.place.carrierOf(kinematics.forward(arm.q));
}

// Draws a new repeatability error where a move has ended.
void settle(EmulatedArm& arm, const ArmKinematics& kinematics, double dt) {
  if (arm.rate.cwiseAbs().maxCoeff() < kStill) {
    const Pose at = byJoints(arm, kinematics);
    if ((at.p - arm.drawn_at.p).norm() > kMinMove) {
      arm.drawn_at = at;
      std::normal_distribution<double> normal(0.0, 1.0);
      for (int i = 0; i < 3; ++i)
        arm.off_goal(i) = arm.parameters.repeatability * normal(arm.random);
    }
  }
  const double fraction = 1.0 - std::exp(-dt / kSettling);
  arm.off += fraction * (arm.off_goal - arm.off);
  arm.sag += fraction * (arm.parameters.compliance.cwiseProduct(arm.force) - arm.sag);
}

}  // namespace

EmulatedArm emulatedArm(const EmulatedArmParameters& parameters, const CellPlace& place,
                        const ArmKinematics& kinematics, const JointVector& q, double time) {
  EmulatedArm arm;
  arm.parameters = parameters;
  arm.place = place;
  arm.time = time;
  arm.q = arm.target = q;
  arm.rate = arm.acceleration = JointVector::Zero(q.size());
  arm.drawn_at = byJoints(arm, kinematics);
  arm.backlash = Backlash(Eigen::Vector3d::Constant(parameters.backlash));
  arm.random.seed(parameters.seed);
  return arm;
}

bool command(EmulatedArm& arm, const JointVector& q, double stamp) {
  if (q.size() != arm.q.size() || !q.allFinite() || !std::isfinite(stamp)) return false;
  if (arm.stopped) return true;
  arm.queue.add(q, stamp, arm.parameters.latency, arm.parameters.jitter, arm.random);
  return true;
}

void load(EmulatedArm& arm, const Vector6& wrench) {
  arm.force = wrench;
  const double force = wrench.head<3>().norm(), torque = wrench.tail<3>().norm();
  const EmulatedArmParameters& p = arm.parameters;
  if (arm.stopped || (force <= p.protective_force && torque <= p.protective_torque)) return;
  stop(arm, text("protective stop: %g N, %g N m at the flange, allowed are %g N, %g N m", force,
                 torque, p.protective_force, p.protective_torque));
}

void advance(EmulatedArm& arm, const ArmKinematics& kinematics, double time) {
  const double dt = 1.0 / arm.parameters.rate;
  while (arm.time + dt <= time + kStamp) {
    while (const auto q = arm.queue.take(arm.time + kStamp)) arm.target = *q;
    arm.time += dt;
    const bool plays = arm.parameters.backlash > 0.0;
    const Eigen::Vector3d before = plays ? byJoints(arm, kinematics).p : Eigen::Vector3d::Zero();
    moveJoints(arm, kinematics.limits(), dt);
    if (plays) arm.backlash.move(byJoints(arm, kinematics).p - before);
    settle(arm, kinematics, dt);
  }
}

void unlock(EmulatedArm& arm) {
  arm.stopped = false;
  arm.why.clear();
}

JointVector encoders(const EmulatedArm& arm) {
  const double step = arm.parameters.encoder_step;
  if (!(step > 0.0)) return arm.q;
  return (arm.q / step).array().round() * step;
}

CarrierPoses carrier(const EmulatedArm& arm, const ArmKinematics& kinematics) {
  const Vector6 shift = arm.off + arm.sag;
  const Pose off{rotationFromVector({shift.tail<3>()}), shift.head<3>()};
  const auto at = [&](double t) {
    const JointVector q = arm.q + t * arm.rate + 0.5 * t * t * arm.acceleration;
    return arm.place.carrierOf(kinematics.forward(q)) * off;
  };
  CarrierPoses poses{kStep, at(-kStep), at(0.0), at(kStep)};
  if (!(arm.parameters.backlash > 0.0)) return poses;
  const Eigen::Vector3d motion = poses.after.p - poses.before.p;
  for (int i = 0; i < 3; ++i) {
    if (!arm.backlash.carries(i, motion(i))) poses.before.p(i) = poses.after.p(i) = poses.at.p(i);
  }
  for (Pose* pose : {&poses.before, &poses.at, &poses.after}) pose->p += arm.backlash.lost();
  return poses;
}

}  // namespace assembly_cell
