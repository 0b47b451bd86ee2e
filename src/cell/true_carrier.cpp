// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/true_carrier.h"

#include <algorithm>

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

}  // namespace

TrueCarrier::TrueCarrier(const Pose& X_HB, const Scenario& scenario, const CarrierTruth& truth)
    : truth_(truth),
      scales_(!truth.scale.isZero(0.0)),
      noisy_(!truth.reading_noise.isZero(0.0)),
      repeats_(!truth.repeatability.isZero(0.0)),
      X_HB_(baseOf(X_HB, truth)),
      last_draw_(poseFromRest(scenario.rest)),
      reading_(truth.reading_seed),
      repeatability_(truth.repeatability_seed) {}

Pose TrueCarrier::scaled(const Pose& pose, bool reported) const {
  if (!scales_) return pose;
  const Eigen::Vector3d factor = Eigen::Vector3d::Ones() + truth_.scale;
  return {pose.R, reported ? Eigen::Vector3d(pose.p.cwiseProduct(factor))
                           : Eigen::Vector3d(pose.p.cwiseQuotient(factor))};
}

void TrueCarrier::command(SimulatorBackend& world, const Pose& pose, double max_speed) const {
  world.setRestTarget(restFromPose(X_HB_ * scaled(pose, false)), max_speed);
}

Pose TrueCarrier::encoders(const SimulatorBackend& world) const {
  const Vector6 shift = world.restShift();
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
  const Pose at = poseFromRest(restPose(restVector(world.rest()) - world.restShift()));
  way_ = std::max(way_, (at.p - last_draw_.p).norm());
  turn_ = std::max(turn_, vectorFromRotation(last_draw_.R.transpose() * at.R).value.norm());
  if (!world.atRest() || (way_ <= kWay && turn_ <= kTurn)) return;
  // rest coordinates: x, y, z, yaw about z, theta about x, phi about y
  const Vector6 d = drawn(truth_.repeatability, repeatability_);
  Vector6 shift;
  shift << d.head<3>(), d(5), d(3), d(4);
  world.setRestShift(shift);
  last_draw_ = at;
  way_ = turn_ = 0.0;
}

}  // namespace assembly_cell
