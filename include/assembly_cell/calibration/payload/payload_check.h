// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Does a recording of static poses mean what it was read as?
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/calibration/payload/payload.h"

namespace assembly_cell {

/// Rotations of the same poses under another convention of their file.
struct OtherRotations {
  std::string name;  ///< such as "the quaternions w first"
  std::vector<Eigen::Matrix3d> R;
};

/// Another reading of a recording that fits better than the one given.
struct OtherReading {
  double better = 1.0;    ///< ratio of the misfits, force times torque, over those of this reading
  bool inverse = false;   ///< the rotations are those of the base in the sensor
  std::string rotations;  ///< name of the OtherRotations, empty: as given
  WrenchAxes force = WrenchAxes::kSensor, torque = WrenchAxes::kSensor;
  /// Rotation of the sensor's axes in those of the poses; of the force's only, if `force_only`.
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  bool force_only = false;
  PlainPayload payload;  ///< weight, centre (in the sensor's own axes) of this reading
  std::string text;      ///< what differs, and what follows; one line
};

/// The best of: the other rotations, both senses of them, forces and torques in base or in sensor
/// axes, all right-handed axes, and any rotation of the sensor on its flange; by ordinary least
/// squares with a constant bias. axes: the reading given (kAuto: the better of the two). gravity:
/// [m/s²] for the mass in the text. At least six poses.
OtherReading otherReading(const std::vector<StaticPose>& poses,
                          const std::vector<OtherRotations>& others,
                          const std::vector<Vector6>& wrenches, WrenchAxes axes, double gravity);

struct PayloadCheckOptions {
  double gravity = 9.80665;  ///< [m/s²]
  bool upside_down = false;  ///< gravity is along the base's +z
};

/// What speaks against the identified payload, one line each, the likely cause first; empty where
/// nothing does. Of a refused model: the likely cause of the refusal, if one is found.
std::vector<std::string> checkPayload(const std::vector<StaticPose>& poses,
                                      const std::vector<OtherRotations>& others,
                                      const std::vector<Vector6>& wrenches,
                                      const PayloadModel& model,
                                      const PayloadCheckOptions& options);

}  // namespace assembly_cell
