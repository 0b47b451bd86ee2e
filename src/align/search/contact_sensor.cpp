// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/contact_sensor.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/align/search/scale.h"

namespace assembly_cell {
namespace {

constexpr double kTouchNoise = 5.0;  // sd of a block's force, all axes, that are no touch
// The norm of a change in three axes is below 2.5 times its rms in 999 of 1000 (chi distribution).
constexpr double kNoiseRms = 2.5;

}  // namespace

ContactSensor::ContactSensor(const PegWeight& weight, double force_scale)
    : weight_(weight), force_scale_(force_scale), touch_(kTouchForce * force_scale) {}

Vector6 ContactSensor::weightChange(const RestPose& from) const {
  if (weight_.peg.mass == 0.0) return Vector6::Zero();
  const auto weight = [this](const RestPose& carrier) {
    // the base is upright to a few degrees, which changes the difference by as much of itself
    const Eigen::Vector3d up = poseFromRest(carrier).R.transpose() * weight_.up;
    return pegWeight(weight_.peg, weight_.gravity, up, Vector6::Zero());
  };
  return weight(last_.carrier) - weight(from);
}

void ContactSensor::setTare(const Tare& tare) {
  tare_ = tare;
  if (!tared_) {
    first_ = tare;
    const Matrix6 of_mean = tare_.scatter / std::max(1, last_.samples) + last_.rounding_b;
    touch_ = std::max(touch_, kTouchNoise * std::sqrt(of_mean.topLeftCorner<3, 3>().trace()));
  }
  tared_ = true;
}

Vector6 ContactSensor::wrench() const {
  return last_.wrench_b - tare_.wrench - weightChange(tare_.pose);
}

double ContactSensor::heldForce() const {
  return (last_.wrench_b - first_.wrench - weightChange(first_.pose)).head<3>().norm();
}

double ContactSensor::tareShift() const {
  return (tare_.wrench - first_.wrench - weightChange(first_.pose)).head<3>().norm();
}

double ContactSensor::noiseChange() const {
  const Matrix6 of_mean = last_.covariance_b / std::max(1, last_.samples) + last_.rounding_b;
  return kNoiseRms * std::sqrt(2 * of_mean.topLeftCorner<3, 3>().trace());
}

ForceAlarm ContactSensor::alarmAt(double force, double sideways) const {
  return {(last_.wrench_b - wrench()).head<3>(), force, sideways};
}

}  // namespace assembly_cell
