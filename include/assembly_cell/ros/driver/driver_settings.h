// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// Parameters of a driver.
struct DriverSettings {
  std::string frame_id;
  std::string calibration_file;  ///< required without a source of the driver's own
  bool publish_displacement = false;
  std::string scenario;  ///< its coupling is the displacement sensor; empty: the calibration's map
  std::vector<std::string> overrides;  ///< of the scenario
  bool lockstep = false;
  std::string name_in_lockstep;
  double display_rate = 50.0;     ///< [Hz]
  double expected_rate = 5000.0;  ///< [Hz]; 0: that of the device, if it reports one
  double rate_tolerance = 0.05;   ///< fraction
  double frozen_after = 1.0;      ///< [s]; 0: never
  int zero_samples = 200;
  double zero_timeout = 30.0, source_timeout = 2.0, diagnostic_period = 1.0;  ///< [s]

  bool has_source = false;  ///< ~source is a device or a recording
};
void fields(FieldList& f, DriverSettings& s);

/// Parameters of a driver that reads a source of its own.
struct SourceSettings {
  int queue_size = 100;                                                ///< blocks
  double read_timeout = 0.1, back_off = 0.25, longest_back_off = 5.0;  ///< [s]
  int realtime_priority = 0;
  double device_bias_timeout = 5.0;         ///< [s]
  double range_force, range_torque;         ///< beyond: saturated [N], [N·m]
  std::array<double, 3> device_position{};  ///< of the device's origin in the sensor's frame [m]
  std::array<double, 3> device_rotation{};  ///< vector, of its axes [rad]

  SourceSettings();
};
void fields(FieldList& f, SourceSettings& s);

/// What a driver requires of its calibration.
struct CalibrationRules {
  bool needs_displacement = false;
  bool calibrated = true;                  ///< a calibration file was given
  std::optional<SampleQuantity> quantity;  ///< of the source; none: not known before it's open
  Matrix6 device_to_sensor = Matrix6::Identity();  ///< of a device's wrenches

  /// Throws InputError, one line that begins with `source`.
  void check(const Calibration& calibration, const std::string& source) const;
};

/// Volts are wrenches.
bool isIdentity(const Calibration& calibration);

}  // namespace assembly_cell::ros_bridge
