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

/// An arm that carries the carrier of a simulated cell, with a bridge before it: what arm_bridge
/// and emulate_arm do in lockstep, by the same functions. Poses are in the carrier's base, times
/// are the cell's [s].
class CarrierArm {
 public:
  /// Stands with the carrier at `carrier`, at time 0. `mechanism`: the nominal parts. `seed`: of
  /// the arm's jitter and repeatability. Throws InputError, also where the arm doesn't reach.
  CarrierArm(const ArmSetup& setup, const Mechanism& mechanism, const Pose& carrier,
             std::uint64_t seed);

  /// Takes a command at `now` and sends the arm the points of the block from there on, of `length`.
  /// How the carrier moves at the block's end. Throws PlantError where the bridge refuses, or holds
  /// the arm.
  CarrierPoses lead(const PlantCommand& command, double now, double length);
  /// Of the block that has passed: 6 × n wrenches of sensor_a or sensor_b (0, 1), the last at
  /// `felt.end`.
  void feel(const ContactSamples& felt);

  /// Both sensors have been heard: commands are taken.
  bool ready() const { return bridge_.wrench_known[0] && bridge_.wrench_known[1]; }
  /// Where the carrier is as the arm's encoders say, at the end of the last block.
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
