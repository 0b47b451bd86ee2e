// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Where the carrier may be sent and how it gets there. Lengths and turns are counted together:
/// a turn by an angle is a way of `arm` times that angle.
struct MotionLimits {
  double speed = 0.05;                        ///< [m/s]
  double acceleration = 1.0;                  ///< [m/s²]
  double arm = 0.08;                          ///< metres of way a radian [m]
  Eigen::Vector3d box_min{-0.1, -0.1, -0.1};  ///< of positions from the start [m]
  Eigen::Vector3d box_max{0.1, 0.1, 0.1};
  double rotation = 0.35;  ///< of the turn from the start: a cone round it [rad]
};

/// Position and rotation vector of a pose. [m], [rad]
Vector6 coordinatesOf(const Pose& X);
Pose poseOfCoordinates(const Vector6& x);
/// Within box and cone. False for what is not finite.
bool isWithin(const MotionLimits& limits, const Vector6& x);

/// The way of an arm from command to command, a point each period. Plain state; no allocation.
///
/// A pursuer goes for the goal with bounded speed and acceleration. It knows in closed form where
/// it would come to rest if it braked now; a step that would take this point out of box or cone
/// isn't done, it brakes instead, which leaves the point where it is. So it never leaves them,
/// whatever is commanded when. What goes out is the mean of its last points: that makes the
/// acceleration continuous (C²) and keeps every bound, for box and cone are convex.
struct CommandMotion {
  static constexpr std::size_t kLongest = 64;  ///< points in the mean

  MotionLimits limits;
  double period = 0.002;      ///< of the points [s]
  std::size_t smoothing = 8;  ///< points in the mean, 1 to kLongest
  double max_speed = 0.05;    ///< of the present move, at most limits.speed [m/s]

  Vector6 goal = Vector6::Zero();
  bool braking = false;  ///< the goal doesn't count: it comes to rest and stays there
  Vector6 at = Vector6::Zero(), step = Vector6::Zero();  ///< pursuer, and its last way in a period
  std::array<Vector6, kLongest> points{};                ///< its last ones, a ring
  std::size_t next = 0;
  Vector6 out = Vector6::Zero();       ///< their mean: where the carrier shall be now
  Vector6 previous = Vector6::Zero();  ///< a period ago
};

/// At rest at X, the next point is there.
void beginMotion(CommandMotion& motion, const Pose& X);
/// From now on to X, no faster than `max_speed` [m/s]. What is not finite or not within the limits
/// is not taken: false.
bool moveTo(CommandMotion& motion, const Pose& X, double max_speed);
/// From now on to rest, as quickly as the acceleration allows.
void brake(CommandMotion& motion);
/// The next point, in `motion.out`.
void stepMotion(CommandMotion& motion);

/// Where `out` comes to rest when it brakes now.
Vector6 restPoint(const CommandMotion& motion);
/// The way there: translation and turn, axes of the carrier's base. [m], [rad]
inline Vector6 stopWay(const CommandMotion& motion) { return restPoint(motion) - motion.out; }
bool isAtRest(const CommandMotion& motion);
/// Where it should be now. [m], [rad]; and its rate [m/s], [rad/s] as rotation vector's rate.
inline Pose motionPose(const CommandMotion& motion) { return poseOfCoordinates(motion.out); }
inline Vector6 motionRate(const CommandMotion& motion) {
  return (motion.out - motion.previous) / motion.period;
}

}  // namespace assembly_cell
