// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/arm/command_motion.h"

namespace assembly_cell {

/// A point of the way in the arm's terms. Poses and twists are of the flange in the arm's base.

struct JointPoint {
  JointVector q;      ///< [rad]
  JointVector rates;  ///< that lead there within a period [rad/s]
  std::string why;    ///< the joints can't: q is as near as they get; empty: they can
};
/// From the joints `before` to the present point of `motion`, no faster than they turn.
JointPoint jointPoint(const ArmKinematics& kinematics, const CellPlace& place,
                      const CommandMotion& motion, const JointVector& before);

/// Velocity and angular velocity in the last period, and `gain` [1/s] times what an arm at
/// `measured` (coordinates) is behind. [m/s], [rad/s]
Vector6 flangeTwist(const CellPlace& place, const CommandMotion& motion, const Vector6& measured,
                    double gain);

}  // namespace assembly_cell
