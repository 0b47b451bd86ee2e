// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/arm/late_motion.h"

namespace assembly_cell {

/// Emulation of an arm with an industrial controller: joints that follow positions with latency,
/// lag, repeatability, backlash and compliance. Times are cell time [s].
struct EmulatedArmParameters {
  double rate = 500.0;          ///< of the controller, 125 to 500 [Hz]
  double latency = 0.01;        ///< from a command's stamp to its effect [s]
  double jitter = 0.001;        ///< of the latency, uniform from 0 [s]
  double bandwidth = 25.0;      ///< of the joints' positions, critically damped [Hz]
  double encoder_step = 1e-6;   ///< resolution of the joint encoders [rad]
  double repeatability = 3e-5;  ///< sd of a move's final position, each axis [m]
  double backlash = 0.0;        ///< of the carrier, whole gap of each axis [m]
  Vector6 compliance = (Vector6() << 5e-7, 5e-7, 5e-7, 2e-5, 2e-5, 2e-5)
                           .finished();  ///< of the flange [m/N], [rad/(N m)]
  double protective_force = 150.0;       ///< protective stop, force at the flange [N]
  double protective_torque = 20.0;       ///< [N m]
  std::uint64_t seed = 1;
};

struct EmulatedArm {
  EmulatedArmParameters parameters;
  CellPlace place;
  double time = 0.0;  ///< last cycle of the controller
  JointVector q, rate, acceleration;
  JointVector target;  ///< present set point of the joints
  CommandQueue<JointVector> queue;
  Backlash backlash;
  bool stopped = false;
  std::string why;                  ///< reason of a protective stop
  Vector6 force = Vector6::Zero();  ///< wrench on the carrier, carrier axes
  Vector6 sag = Vector6::Zero();    ///< displacement of the carrier by it
  Vector6 off = Vector6::Zero();    ///< repeatability error of the last move
  Vector6 off_goal = Vector6::Zero();
  Pose drawn_at;  ///< pose at which `off_goal` was drawn
  std::mt19937_64 random;
};

/// Poses of the carrier in carrier_base before, at and after a time, for its rate and
/// acceleration.
struct CarrierPoses {
  double step = 0.0;  ///< [s]
  Pose before, at, after;
};

/// At rest with the joints at q.
EmulatedArm emulatedArm(const EmulatedArmParameters& parameters, const CellPlace& place,
                        const ArmKinematics& kinematics, const JointVector& q, double time);
/// Commands joint positions at `stamp`. False if they are of the wrong size or not finite.
bool command(EmulatedArm& arm, const JointVector& q, double stamp);
/// Sets force and torque on the carrier; beyond the protective limits the arm stops.
void load(EmulatedArm& arm, const Vector6& wrench);
/// Runs the controller's cycles until `time`.
void advance(EmulatedArm& arm, const ArmKinematics& kinematics, double time);
/// Ends a protective stop.
void unlock(EmulatedArm& arm);

/// Encoder readings of the joints.
JointVector encoders(const EmulatedArm& arm);
/// Poses of the carrier, sag, repeatability and backlash included.
CarrierPoses carrier(const EmulatedArm& arm, const ArmKinematics& kinematics);

}  // namespace assembly_cell
