// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/true_carrier.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

constexpr double kWay = 2e-4,
                 kTurn = 2e-3;  // move that draws another error of repeatability [m], [rad]

Pose baseOf(const Pose& X_HB, const CarrierTruth& truth) {
  if (truth.rotation.isZero(0.0) && truth.offset.isZero(0.0)) return X_HB;
  return X_HB * Pose{rotationFromVector({truth.rotation}), truth.offset};
}

Vector6 drawn(const Eigen::Vector3d& sd, NormalSource& normal) {
  Vector6 values;
  for (int i = 0; i < 6; ++i)
    values(i) = (i < 3 ? 1.0 : CarrierTruth::kTurn) * sd(i % 3) * normal();
  return values;
}

constexpr double kDriveStep = 1e-3;  // cycle of a drive that is not exact [s]
constexpr double kLagEnd = 1e-9;     // distance at which a lag counts as over [m], [rad]

bool isLate(const CarrierTruth& truth) {
  return truth.latency > 0.0 || truth.jitter > 0.0 || truth.lag > 0.0 ||
         !truth.backlash.isZero(0.0);
}

}  // namespace

TrueCarrier::TrueCarrier(const Pose& X_HB, const Scenario& scenario, const CarrierTruth& truth)
    : truth_(truth),
      scales_(!truth.scale.isZero(0.0)),
      noisy_(!truth.reading_noise.isZero(0.0)),
      repeats_(!truth.repeatability.isZero(0.0)),
      late_(isLate(truth)),
      X_HB_(baseOf(X_HB, truth)),
      last_draw_(poseFromRest(scenario.rest)),
      reading_(truth.reading_seed),
      repeatability_(truth.repeatability_seed),
      jitter_(truth.jitter_seed),
      commanded_(restProfile(scenario.rest)),
      backlash_(truth.backlash) {
  driven_.position = restVector(scenario.rest);
}

Pose TrueCarrier::scaled(const Pose& pose, bool reported) const {
  if (!scales_) return pose;
  const Eigen::Vector3d factor = Eigen::Vector3d::Ones() + truth_.scale;
  return {pose.R, reported ? Eigen::Vector3d(pose.p.cwiseProduct(factor))
                           : Eigen::Vector3d(pose.p.cwiseQuotient(factor))};
}

void TrueCarrier::command(SimulatorBackend& world, const Pose& pose, double max_speed) {
  const RestPose target = restFromPose(X_HB_ * scaled(pose, false));
  if (!late_) return world.setRestTarget(target, max_speed);
  queue_.add({target, max_speed}, world.time(), truth_.latency, truth_.jitter, jitter_);
}

void TrueCarrier::stop(SimulatorBackend& world) {
  world.stopRest();
  queue_.clear();
  stopping_ = late_;
}

// The drive's motion at `to`: the profile of the commands, its lag, and the gap behind it. The lag
// is exact for a commanded motion that is straight over the cycle.
void TrueCarrier::drive(const SimulatorBackend& world, double from, double to) {
  const Mechanism& mechanism = world.scenario().mechanism;
  while (const auto command = queue_.take(from + 0.5 * kDriveStep)) {
    CarrierParameters limits = mechanism.carrier;
    limits.max_speed = std::min(limits.max_speed, command->max_speed);
    commanded_ = planRest(restMotion(commanded_, from), from, command->target, limits,
                          mechanism.peg.coupling_height + mechanism.peg.half_height);
  }
  const Vector6 before = driven_.position;
  const Vector6 start = restMotion(commanded_, from).position;
  driven_ = restMotion(commanded_, to);
  if (truth_.lag > 0.0) {
    const double decay = std::exp((from - to) / truth_.lag);
    const Vector6 step = driven_.position - start;
    const Vector6 behind =
        decay * (start - before) + truth_.lag / (to - from) * (1.0 - decay) * step;
    if (behind.cwiseAbs().maxCoeff() > kLagEnd) {
      const Vector6 rate = behind / truth_.lag;
      driven_ = {driven_.position - behind, rate, (driven_.rate - rate) / truth_.lag};
    }
  }
  backlash_.move((driven_.position - before).head<3>());
}

void TrueCarrier::lead(SimulatorBackend& world, double end) {
  if (!late_) return;
  const double start = world.time();
  if (stopping_) {
    if (!world.atRest()) return;
    stopping_ = false;
    commanded_ = restProfile(restPose(carriedRest(world)));
    driven_ = restMotion(commanded_, start);
  }
  const Vector6 before = driven_.position;
  const int steps = std::max(1, static_cast<int>(std::lround((end - start) / kDriveStep)));
  const double step = (end - start) / steps;
  for (int i = 0; i < steps; ++i) drive(world, start + i * step, start + (i + 1) * step);
  // the block after a motion still ends a quintic, which then stays where it is
  const bool moved = driven_.position != before;
  if (!moved && !moved_) return;
  moved_ = moved;
  RestMotion goal = driven_;
  goal.position.head<3>() += backlash_.lost();
  for (int i = 0; i < 3; ++i) {
    if (backlash_.carries(i, driven_.rate(i))) continue;
    goal.rate(i) = goal.acceleration(i) = 0.0;
  }
  world.followRest(goal, end);
}

// Rest pose as the encoders measure it.
Vector6 TrueCarrier::carriedRest(const SimulatorBackend& world) const {
  Vector6 rest = restVector(world.rest()) - world.restShift();
  rest.head<3>() -= backlash_.lost();
  return rest;
}

bool TrueCarrier::isStill(const SimulatorBackend& world) const {
  return late_ ? queue_.empty() && driven_.rate.isZero(0.0) && !stopping_ : world.atRest();
}

Pose TrueCarrier::encoders(const SimulatorBackend& world) const {
  Vector6 shift = world.restShift();
  shift.head<3>() += backlash_.lost();
  if (shift.isZero(0.0)) return scaled(inverse(X_HB_) * world.carrierPose(), true);
  RestPose carrier = world.carrier();
  carrier.x -= shift(0);
  carrier.y -= shift(1);
  carrier.z -= shift(2);
  carrier.yaw -= shift(3);
  carrier.theta -= shift(4);
  carrier.phi -= shift(5);
  return scaled(inverse(X_HB_) * poseFromRest(carrier), true);
}

Pose TrueCarrier::report(const SimulatorBackend& world) {
  Pose pose = encoders(world);
  if (!noisy_) return pose;
  const Vector6 noise = drawn(truth_.reading_noise, reading_);
  pose.p += noise.head<3>();
  pose.R = pose.R * rotationFromVector({noise.tail<3>()});
  return pose;
}

void TrueCarrier::settle(SimulatorBackend& world) {
  if (!repeats_) return;
  const Pose at = poseFromRest(restPose(carriedRest(world)));
  way_ = std::max(way_, (at.p - last_draw_.p).norm());
  turn_ = std::max(turn_, vectorFromRotation(last_draw_.R.transpose() * at.R).value.norm());
  if (!isStill(world) || (way_ <= kWay && turn_ <= kTurn)) return;
  // rest coordinates: x, y, z, yaw about z, theta about x, phi about y
  const Vector6 d = drawn(truth_.repeatability, repeatability_);
  Vector6 shift;
  shift << d.head<3>(), d(5), d(3), d(4);
  world.setRestShift(shift);
  last_draw_ = at;
  way_ = turn_ = 0.0;
}

}  // namespace assembly_cell
