// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/command_motion.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

constexpr double kRounding = 1e-12;  // of a value at a limit [m], [rad]

// Rotations as lengths, and back. [m]
Vector6 weighted(const MotionLimits& limits, const Vector6& x) {
  Vector6 y = x;
  y.tail<3>() *= limits.arm;
  return y;
}
Vector6 unweighted(const MotionLimits& limits, const Vector6& y) {
  Vector6 x = y;
  x.tail<3>() /= limits.arm;
  return x;
}

// Stopping distance from the next period on after a period's step `step`, when braking shortens
// each step by `less`.
double stoppingDistance(double step, double less) {
  const double n = std::floor(step / less);
  return n * step - 0.5 * less * n * (n + 1.0);
}

// Step of the coming period after which braking ends at `distance`.
double stepThatEndsAt(double distance, double less) {
  const double n = std::floor(0.5 * (std::sqrt(1.0 + 8.0 * distance / less) - 1.0));
  return (distance + 0.5 * less * n * (n + 1.0)) / (n + 1.0);
}

Vector6 restOf(const Vector6& at, const Vector6& step, double less) {
  const double size = step.norm();
  if (!(size > 0.0)) return at;
  return at + step / size * stoppingDistance(size, less);
}

}  // namespace

Vector6 coordinatesOf(const Pose& X) {
  Vector6 x;
  x << X.p, vectorFromRotation(X.R).value;
  return x;
}

Pose poseOfCoordinates(const Vector6& x) {
  return {rotationFromVector({x.tail<3>()}), x.head<3>()};
}

bool isWithin(const MotionLimits& limits, const Vector6& x) {
  for (int i = 0; i < 3; ++i) {
    if (!(x(i) >= limits.box_min(i) - kRounding && x(i) <= limits.box_max(i) + kRounding)) {
      return false;
    }
  }
  return x.tail<3>().norm() <= limits.rotation + kRounding;
}

void beginMotion(CommandMotion& motion, const Pose& X) {
  const Vector6 x = coordinatesOf(X);
  motion.goal = motion.out = motion.previous = x;
  motion.at = weighted(motion.limits, x);
  motion.step.setZero();
  motion.points.fill(x);
  motion.next = 0;
  motion.braking = false;
}

bool moveTo(CommandMotion& motion, const Pose& X, double max_speed) {
  if (!X.p.allFinite() || !X.R.allFinite()) return false;
  const Vector6 goal = coordinatesOf(X);
  if (!isWithin(motion.limits, goal) || !(max_speed > 0.0)) return false;
  motion.goal = goal;
  motion.max_speed = std::min(max_speed, motion.limits.speed);
  motion.braking = false;
  return true;
}

void brake(CommandMotion& motion) { motion.braking = true; }

void stepMotion(CommandMotion& motion) {
  const MotionLimits& limits = motion.limits;
  const double less = limits.acceleration * motion.period * motion.period;
  const Vector6 present = motion.step;
  const double size = present.norm();
  // braking: along the present direction
  Vector6 step = Vector6::Zero();
  if (size > less) step = present * (1.0 - less / size);
  if (!motion.braking) {
    const Vector6 way = weighted(limits, motion.goal) - motion.at;
    const double distance = way.norm();
    Vector6 wanted = Vector6::Zero();
    if (distance > 0.0) {
      wanted = way / distance *
               std::min(stepThatEndsAt(distance, less), motion.max_speed * motion.period);
    }
    Vector6 change = wanted - present;
    const double amount = change.norm();
    if (amount > less) change *= less / amount;
    const Vector6 candidate = present + change;
    const bool within =
        isWithin(limits, unweighted(limits, restOf(motion.at + candidate, candidate, less)));
    if (within) step = candidate;
  }
  motion.step = step;
  motion.at += step;
  motion.points[motion.next] = unweighted(limits, motion.at);
  motion.next = (motion.next + 1) % motion.smoothing;
  motion.previous = motion.out;
  motion.out.setZero();
  for (std::size_t i = 0; i < motion.smoothing; ++i) motion.out += motion.points[i];
  motion.out /= static_cast<double>(motion.smoothing);
}

Vector6 restPoint(const CommandMotion& motion) {
  const MotionLimits& limits = motion.limits;
  const double less = limits.acceleration * motion.period * motion.period;
  return unweighted(limits, restOf(motion.at, motion.step, less));
}

bool isAtRest(const CommandMotion& motion) {
  constexpr double kStill = 1e-9;  // [m], [rad]
  return motion.step.isZero(0.0) && (motion.out - motion.previous).norm() < kStill &&
         stopWay(motion).norm() < kStill &&
         (motion.braking || (unweighted(motion.limits, motion.at) - motion.goal).norm() < kStill);
}

}  // namespace assembly_cell
