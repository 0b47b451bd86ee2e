// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <vector>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/arm/arm_point.h"
#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// Motion of the rest pose at the time of `poses`, which are in the carrier's base at X_HB in
/// `hole`.
RestMotion restMotionOf(const CarrierPoses& poses, const Pose& X_HB);

/// An arm that moves the carrier of a simulated cell, with its bridge: arm_bridge and emulate_arm
/// in lockstep, by the same functions. Poses are in the carrier's base, times
/// are the cell's [s].
class CarrierArm {
 public:
  /// At rest with the carrier at `carrier`, at time 0. `mechanism`: the nominal parts. `seed`: of
  /// the arm's jitter and repeatability. Throws InputError, also if `carrier` is out of reach.
  CarrierArm(const ArmSetup& setup, const Mechanism& mechanism, const Pose& carrier,
             std::uint64_t seed, Sensors sensors = Sensors::kBoth);

  /// Carries out a command at `now` and moves the arm over a block of `length`. Returns the
  /// carrier's motion at the block's end. Throws PlantError if the bridge refuses or holds the arm.
  CarrierPoses lead(const PlantCommand& command, double now, double length);
  /// Wrenches of sensor_a or sensor_b over the last block.
  void addWrenches(const ContactSamples& samples);

  /// Wrenches of all sensors have arrived: commands are taken.
  bool ready() const { return knowsWrenches(bridge_); }
  /// The carrier by the arm's encoders at the end of the last block, in its base.
  Pose reported() const { return poseOfCoordinates(bridge_.measured); }

 private:
  void take(const PlantCommand& command, double now);
  void mustFollow() const;

  CellPlace place_;
  ArmKinematics kinematics_;
  ArmGuard bridge_;
  EmulatedArm arm_;
  JointVector sent_;  // the last point
  std::vector<JointPoint> points_;
};

}  // namespace assembly_cell
