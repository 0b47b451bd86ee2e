// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <deque>
#include <random>
#include <string>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"

namespace assembly_cell {

/// What stands for an arm in tests: joints that follow positions as an industrial controller makes
/// them, late and not quite exactly. Times are cell time [s].
struct EmulatedArmParameters {
  double rate = 500.0;          ///< of its controller, 125 to 500 [Hz]
  double latency = 0.01;        ///< from a command's stamp to its effect [s]
  double jitter = 0.001;        ///< of the latency, uniform from 0 [s]
  double bandwidth = 25.0;      ///< of the joints' positions, critically damped [Hz]
  double encoder_step = 1e-6;   ///< of a joint's reading [rad]
  double repeatability = 3e-5;  ///< sd of where a move ends, each axis [m]
  Vector6 compliance = (Vector6() << 5e-7, 5e-7, 5e-7, 2e-5, 2e-5, 2e-5)
                           .finished();  ///< of the flange [m/N], [rad/(N m)]
  double protective_force = 150.0;       ///< at the flange: it stops by itself [N]
  double protective_torque = 20.0;       ///< [N m]
  std::uint64_t seed = 1;
};

struct EmulatedArm {
  EmulatedArmParameters parameters;
  CellPlace place;
  double time = 0.0;  ///< of the last cycle
  JointVector q, rate, acceleration;
  JointVector target;  ///< where the joints are going now
  struct Command {
    double due = 0.0;
    JointVector q;
  };
  std::deque<Command> queue;
  bool stopped = false;
  std::string why;                  ///< it was stopped
  Vector6 force = Vector6::Zero();  ///< of the environment on the carrier, carrier's axes
  Vector6 sag = Vector6::Zero();    ///< of the carrier, by that force
  Vector6 off = Vector6::Zero();    ///< from its encoders' pose: where the last move ended
  Vector6 off_goal = Vector6::Zero();
  Pose drawn_at;  ///< where `off_goal` was drawn
  std::mt19937_64 random;
};

/// Poses of the carrier in its base before, at and after a time: they tell its rate and
/// acceleration.
struct CarrierPoses {
  double step = 0.0;  ///< [s]
  Pose before, at, after;
};

/// Stands at rest with the joints at q.
EmulatedArm emulatedArm(const EmulatedArmParameters& parameters, const CellPlace& place,
                        const ArmKinematics& kinematics, const JointVector& q, double time);
/// A command of where the joints shall be, made at `stamp`. Of the wrong size or not finite it is
/// not taken: false.
bool command(EmulatedArm& arm, const JointVector& q, double stamp);
/// Force and torque on the carrier now; too much of it stops the arm.
void load(EmulatedArm& arm, const Vector6& wrench);
/// Cycles of the controller until `time`.
void advance(EmulatedArm& arm, const ArmKinematics& kinematics, double time);
/// By a person, after a protective stop.
void unlock(EmulatedArm& arm);

/// What its encoders say.
JointVector encoders(const EmulatedArm& arm);
/// Where the carrier really is.
CarrierPoses carrier(const EmulatedArm& arm, const ArmKinematics& kinematics);

}  // namespace assembly_cell
