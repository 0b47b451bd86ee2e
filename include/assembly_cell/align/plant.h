// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "assembly_cell/align/failure.h"
#include "assembly_cell/locus/reading.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// A request for one reading of the locus over the samples in [start, start + duration).
struct LocusRequest {
  double start = 0.0;     ///< plant clock [s]
  double duration = 0.0;  ///< [s]
};

/// Limits of sensor_b's force minus `reference`, beyond which a step ends early. They have an
/// effect where blocks are shorter than steps, see step.h.
struct ForceAlarm {
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();        ///< [N]
  double force = std::numeric_limits<double>::infinity();     ///< [N]
  double sideways = std::numeric_limits<double>::infinity();  ///< of x and y alone [N]
};

/// Command before the next block. Nothing set: only wait.
struct PlantCommand {
  std::optional<RestPose> rest;  ///< move the rest pose there, in the carrier's base frame
  std::optional<ExciterParameters>
      exciter;  ///< amplitude 0: off; the phase refers to the block's start
  std::optional<LocusRequest> locus;
  std::optional<LocusRequest> vibration;  ///< the same of sensor_b's wrench itself
  std::optional<ForceAlarm> alarm;        ///< ends the step early
};

/// Measurements of one block of samples: means over the block.
struct PlantBlock {
  double time = 0.0;                       ///< end of the block, plant clock [s]
  double length = 0.0;                     ///< of the block [s]
  Vector6 wrench_a = Vector6::Zero();      ///< sensor_a axes, untared; 0 without one [N], [N·m]
  Vector6 wrench_b = Vector6::Zero();      ///< sensor_b axes, untared
  Matrix6 covariance_a = Matrix6::Zero();  ///< of one sample of wrench_a about the mean
  Matrix6 covariance_b = Matrix6::Zero();
  Matrix6 rounding_a = Matrix6::Zero();  ///< that the converter adds to every mean
  Matrix6 rounding_b = Matrix6::Zero();
  int samples = 0;                           ///< in the block
  Vector6 displacement_b = Vector6::Zero();  ///< of the coupling, sensor_b axes [m], [rad]
  bool saturated = false;                    ///< any channel of either sensor
  RestPose carrier;                          ///< its pose in its base frame, by its encoders
  std::optional<LocusReading> locus;         ///< in the first block at or after the window's end
  /// Start of the current window, plant clock: later than requested where it was restarted [s].
  double reading_start = 0.0;
  /// Likewise of sensor_b's wrench, fitVibration() at the commanded angle of the exciter.
  std::optional<HarmonicFit> vibration;
};

class TwinForceSensing;

/// The cell for a strategy: simulated in core, or through ROS in the supervisor. It has no
/// information about where the hole is.
class Plant {
 public:
  virtual ~Plant() = default;
  /// Carries out the command, waits for the next block and returns it. Throws PlantError when the
  /// plant stopped, timed out or was cancelled.
  virtual PlantBlock next(const PlantCommand& command) = 0;
  /// Contacts measured by both sensors, see twin_sensing.h; null with sensor_b alone.
  virtual TwinForceSensing* twinForce() { return nullptr; }
};

/// The plant can't go on; what() is the reason in one line.
struct PlantError : std::runtime_error {
  PlantError(AlignFailure failed, const std::string& reason, const std::string& name = "")
      : std::runtime_error(reason),
        failure(failed),
        status(name.empty() ? toString(failed) : name) {}
  AlignFailure failure;
  int contacts = 0;    ///< locus measurements and touches before the failure
  std::string status;  ///< reason why a simulation stopped; else the failure's name
};

}  // namespace assembly_cell
