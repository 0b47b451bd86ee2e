// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/arm/command_motion.h"

namespace assembly_cell {

/// A point of the commanded motion as joints or twist. Poses and twists are those of the flange in
/// the arm's base.

struct JointPoint {
  JointVector q;      ///< [rad]
  JointVector rates;  ///< from the previous point within a period [rad/s]
  std::string why;    ///< why the joints don't reach the point: q is the nearest; empty: they do
};
/// From the joints `before` to the present point of `motion`, within the joints' speed limits.
JointPoint jointPoint(const ArmKinematics& kinematics, const CellPlace& place,
                      const CommandMotion& motion, const JointVector& before);

/// Velocity and angular velocity in the last period, plus `gain` [1/s] times the following error of
/// an arm at `measured` (coordinates). [m/s], [rad/s]
Vector6 flangeTwist(const CellPlace& place, const CommandMotion& motion, const Vector6& measured,
                    double gain);

}  // namespace assembly_cell
