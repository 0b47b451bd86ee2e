// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// What turns volts into a wrench and a displacement. Linear.
struct Calibration {
  std::string id;
  std::string serial_number;
  std::string date;
  Matrix6 volts_to_wrench = Matrix6::Zero();        ///< S: [N/V], [N·m/V], sensor frame
  Matrix6 volts_to_displacement = Matrix6::Zero();  ///< T: [m/V], [rad/V]; zero where rigid
  Vector6 zero_volts = Vector6::Zero();             ///< reading of the unloaded sensor [V]
};

/// w = S (v − v0), force before torque.
inline Vector6 wrenchFromVolts(const Calibration& c, const Vector6& volts) {
  return c.volts_to_wrench * (volts - c.zero_volts);
}

/// d = T (v − v0): x y z [m], rotation vector [rad] of the coupling point relative to rest.
inline Vector6 displacementFromVolts(const Calibration& c, const Vector6& volts) {
  return c.volts_to_displacement * (volts - c.zero_volts);
}

/// Throws InputError, one line beginning with `source` and naming the item: no id or serial number,
/// a non-finite number, or a singular volts_to_wrench.
void checkCalibration(const Calibration& calibration, const std::string& source);

/// CRC-32 over strings and numbers (shortest text that reads back), "crc32:" and eight hexadecimal
/// digits.
std::string calibrationChecksum(const Calibration& calibration);

/// Reads and checks a calibration file (matrices as {rows, cols, data}, checksum). Throws
/// InputError for an unreadable, foreign, corrupt (checksum) or non-finite file.
Calibration loadCalibration(const std::string& path);

/// Writes atomically: temporary file, fsync, rename. Throws InputError when it cannot.
void saveCalibration(const Calibration& calibration, const std::string& path);

}  // namespace assembly_cell
