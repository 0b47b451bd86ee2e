// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_guard.h"
#include "assembly_cell/arm/emulated_arm.h"
#include "assembly_cell/base/number_field.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// What arm_bridge is told about points and limits, see config/arm/arm_bridge.yaml.
struct BridgeSettings {
  double rate = 500.0;      ///< points a second [Hz]
  double smoothing = 0.02;  ///< a point is the mean of those within this time [s]
  std::array<double, 6> workspace{-0.1, 0.1, -0.1, 0.1, -0.1, 0.1};  ///< x from, to, y, z [m]
  ArmLimits limits;  ///< their box is `workspace`, see bridgeGuard()
};

/// By their names in files and parameters; they point into what is given.
std::vector<NumberField> fieldsOf(BridgeSettings& settings);
/// The same of an emulated arm.
std::vector<NumberField> fieldsOf(EmulatedArmParameters& parameters);

/// The guard of a bridge at the beginning. The coupling of `mechanism` is what a stop strains.
/// Throws InputError that begins with `source`: a workspace from high to low, more points in a mean
/// than there is room for.
ArmGuard bridgeGuard(const BridgeSettings& settings, const Mechanism& mechanism, LeaseMode lease,
                     bool lockstep, const std::string& source);

/// An arm that isn't there with the bridge before it, as `align --arm` reads it.
struct ArmSetup {
  std::string urdf;    ///< text of the arm's URDF
  std::string source;  ///< its file
  std::string file;    ///< that named the others
  CellPlace place;
  BridgeSettings bridge;
  EmulatedArmParameters arm;
  std::vector<double> home;  ///< joints near the place of the carrier, from the base on [rad]
};
/// Reads a file that names those of URDF, place, bridge and emulated arm, relative to itself. The
/// arm is commanded by joints. Throws InputError naming file, key, value and remedy.
ArmSetup loadArmSetup(const std::string& path);

}  // namespace assembly_cell
