// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

/// The simulated calibration bench: two sensors (bridge.h) as hidden ground truth, masses, dial
/// gauges.
struct RigSettings {
  int bits = 16;
  double noise = 0.5e-3;         ///< of one sample, rms [V]
  double nonlinearity = 1.0;     ///< of the bridges: 0 linear … 1 as built
  double drift = 0.0;            ///< of the temperature [K/h]
  bool reference_errors = true;  ///< known values have random errors of `accuracy`
  ReferenceAccuracy accuracy;
  double gravity = 9.80665;
  int samples = 20;             ///< averaged by measure(); unloaded readings take 100
  double sample_period = 2e-4;  ///< [s]
  double test_time = 60.0;      ///< from one test to the next [s]
  std::uint64_t seed = 1;
  /// Wrench on a bridge = gain · wrench on its sensor, SI units: deviation from the drawing.
  PerSide<Matrix6> gain{Matrix6::Identity(), Matrix6::Identity()};
  /// Compliance of the coupling that sensor_b is: displacement of its origin, x y z [m] and
  /// rotation vector [rad], which the gauges read, per wrench in its frame. None: compliance of the
  /// sensor's own hinges.
  std::optional<Matrix6> coupling_compliance;
};

class CalibrationRig {
 public:
  explicit CalibrationRig(const RigSettings& settings);

  /// Applies the load. Returns the observation as a person would note it: known values with
  /// their errors, gauges read, no readings of the sensors. Throws InputError for a request that
  /// can't be done.
  Observation apply(const LoadRequest& request);

  /// One sample of both sensors under the present load; time advances by a sample period.
  PerSide<StrainSample> sample();

  /// apply() and averaged readings: one complete observation.
  Observation measure(const LoadRequest& request);

  /// Header of an observation file for these sensors, no observations.
  ObservationSet description() const;

  double time() const { return time_; }
  double temperature() const;  ///< [°C]

 private:
  std::vector<double> gauges(Side side, const Vector6& wrench);

  RigSettings settings_;
  PerSide<Bridge> bridge_;
  NormalSource normal_;
  double time_ = 0.0;
  PerSide<Vector6> volts_ = {Vector6::Zero(), Vector6::Zero()};  ///< strain under load
};

}  // namespace assembly_cell
