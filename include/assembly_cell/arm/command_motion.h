// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Limits of the commanded motion. Translations and rotations are combined: a rotation counts as
/// `arm` times its angle.
struct MotionLimits {
  double speed = 0.05;                        ///< [m/s]
  double acceleration = 1.0;                  ///< [m/s²]
  double arm = 0.08;                          ///< lever of a rotation [m]
  Eigen::Vector3d box_min{-0.1, -0.1, -0.1};  ///< positions relative to the start [m]
  Eigen::Vector3d box_max{0.1, 0.1, 0.1};
  double rotation = 0.35;  ///< angle from the start: a cone [rad]
};

/// Position and rotation vector of a pose. [m], [rad]
Vector6 coordinatesOf(const Pose& X);
Pose poseOfCoordinates(const Vector6& x);
/// Within box and cone; false if not finite.
bool isWithin(const MotionLimits& limits, const Vector6& x);

/// Motion of an arm from command to command, a point each period. Plain state; no allocation.
///
/// A pursuer moves towards the goal with bounded speed and acceleration. Its rest point under full
/// braking has a closed form; a step whose rest point is outside box or cone is replaced by
/// braking, which keeps the rest point. So the pursuer stays within box and cone for any sequence
/// of commands. The output is the mean of its last points: the acceleration is continuous (C²), and
/// all bounds hold because box and cone are convex.
struct CommandMotion {
  static constexpr std::size_t kMaxSmoothing = 64;  ///< points in the mean

  MotionLimits limits;
  double period = 0.002;      ///< of the points [s]
  std::size_t smoothing = 8;  ///< points in the mean, 1 to kMaxSmoothing
  double max_speed = 0.05;    ///< of the present move, at most limits.speed [m/s]

  Vector6 goal = Vector6::Zero();
  bool braking = false;  ///< comes to rest and stays there, the goal is ignored
  Vector6 at = Vector6::Zero(), step = Vector6::Zero();  ///< pursuer, and its last step
  std::array<Vector6, kMaxSmoothing> points{};           ///< the pursuer's last positions, a ring
  std::size_t next = 0;
  Vector6 out = Vector6::Zero();       ///< their mean: the commanded coordinates
  Vector6 previous = Vector6::Zero();  ///< `out` one period before
};

/// Starts at rest at X; the next point is X.
void beginMotion(CommandMotion& motion, const Pose& X);
/// Sets the goal X, with at most `max_speed` [m/s]. False if X is not finite or not within the
/// limits; the goal stays.
bool moveTo(CommandMotion& motion, const Pose& X, double max_speed);
/// Brakes to rest with the full acceleration.
void brake(CommandMotion& motion);
/// Computes the next point, `motion.out`.
void stepMotion(CommandMotion& motion);

/// Point where `out` comes to rest if it brakes now.
Vector6 restPoint(const CommandMotion& motion);
/// Translation and rotation vector from `out` to restPoint(), axes of carrier_base. [m], [rad]
inline Vector6 stopWay(const CommandMotion& motion) { return restPoint(motion) - motion.out; }
bool isAtRest(const CommandMotion& motion);
/// Commanded pose, and its rate (velocity and rate of the rotation vector). [m/s], [rad/s]
inline Pose motionPose(const CommandMotion& motion) { return poseOfCoordinates(motion.out); }
inline Vector6 motionRate(const CommandMotion& motion) {
  return (motion.out - motion.previous) / motion.period;
}

}  // namespace assembly_cell
