// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_bridge.h"
#include "assembly_cell/arm/emulated_arm.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

class FieldList;

/// How an arm is commanded.
enum class ArmInterface {
  kPose,   ///< geometry_msgs/PoseStamped of the flange on target_frame
  kTwist,  ///< geometry_msgs/TwistStamped of the flange on twist
  kJoints  ///< trajectory_msgs/JointTrajectory of one point on command
};
/// What an arm reports.
enum class ArmStateSource {
  kJoints,  ///< sensor_msgs/JointState on joint_states
  kPose     ///< geometry_msgs/PoseStamped of the flange on current_pose
};

/// Settings of arm_bridge, see config/arm/arm_bridge.yaml.
struct BridgeSettings {
  ArmInterface interface = ArmInterface::kJoints;
  ArmStateSource state = ArmStateSource::kJoints;
  std::string description = "arm_description";
  std::string base_frame;
  double rate = 500.0;      ///< of the points [Hz]
  double smoothing = 0.02;  ///< a point is the mean of those within this time [s]
  double twist_gain = 5.0;  ///< of the following error in twists [1/s]
  LeaseMode lease = LeaseMode::kAuto;
  double payload_mass = 0.0;               ///< [kg]
  std::array<double, 3> payload_centre{};  ///< in sensor_b [m]
  bool publish_frames = true;
  std::array<double, 6> workspace{-0.1, 0.1, -0.1, 0.1, -0.1, 0.1};  ///< min, max of x, y, z [m]
  ArmLimits limits;  ///< their box is `workspace`, see bridgeGuard()
};
void fields(FieldList& f, BridgeSettings& settings);

/// Settings of emulate_arm, see config/arm/emulate_arm.yaml.
struct EmulatedArmSettings {
  ArmInterface interface = ArmInterface::kJoints;
  std::string description = "arm_description";
  EmulatedArmParameters arm;
  std::vector<double> home;  ///< joints near the carrier's start, from the base on [rad]
};
/// `home` is read with the size that it has.
void fields(FieldList& f, EmulatedArmSettings& settings);

/// Initial state of a bridge's guard; a stop is checked against the coupling of `mechanism`. Throws
/// InputError that begins with `source`: a workspace with min above max, too many points in a mean.
ArmGuard bridgeGuard(const BridgeSettings& settings, const Mechanism& mechanism, LeaseMode lease,
                     bool lockstep, const std::string& source);
/// Payload for the gravity of `mechanism`.
Payload payloadOf(const BridgeSettings& settings, const Mechanism& mechanism,
                  const CellPlace& place);

/// An emulated arm and its bridge, as `align --arm` reads them.
struct ArmSetup {
  std::string urdf;    ///< text of the arm's URDF
  std::string source;  ///< its file
  std::string file;    ///< that names the others
  CellPlace place;
  BridgeSettings bridge;
  EmulatedArmSettings arm;
};
/// Reads a file that names the files of URDF, place, bridge and emulated arm, relative to itself.
/// The arm is commanded by joints. Throws InputError naming file, key, value and remedy.
ArmSetup loadArmSetup(const std::string& path);

}  // namespace assembly_cell
