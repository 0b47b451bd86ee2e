// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Recordings of static poses: CSV with optional header (docs/how_to/payload.md).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "assembly_cell/calibration/payload/payload.h"
#include "assembly_cell/calibration/payload/payload_check.h"

namespace assembly_cell {

struct Poses {
  std::vector<StaticPose> values;
  std::vector<OtherRotations> others;  ///< as the file may be meant, too
  bool ordered = false;
  std::optional<double> gravity;  ///< mean length of gx gy gz, where the file has them [m/s²]
};

struct Wrenches {
  std::vector<Vector6> values;
  std::vector<double> temperature;
  bool header = false;
};

/// What turns joint angles into the rotation of the sensor in the base.
struct JointAngles {
  std::vector<std::string> names;  ///< of the joints, in the order of the angles
  std::function<Eigen::Matrix3d(const std::vector<double>&)> rotation;
};

/// Rotations in a table: qx qy qz qw (near unit length), r11 r12 … r33 (near a rotation), row by
/// row, or by a header rx ry rz: rotation vectors [rad]. Throws InputError naming file, line and
/// column.
std::vector<Eigen::Matrix3d> readRotations(Table& table);

/// Throw InputError naming file, line and column; gx gy gz must be of the length of gravity in each
/// row. joints: its columns, or j1, j2 …, in place of rotations.
Poses readPoses(const std::string& path, const JointAngles* joints = nullptr);
Wrenches readWrenches(const std::string& path);

}  // namespace assembly_cell
