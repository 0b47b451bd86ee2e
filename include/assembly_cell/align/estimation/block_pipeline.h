// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/mechanism/sensors.h"
#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/sensor_samples.h"

namespace assembly_cell {

/// From the samples of sensor_a and sensor_b to the block that a strategy evaluates: the last stage
/// of every plant, below the strategies and above the drivers. It sets all of PlantBlock but
/// `time`, `carrier` and readings, which the plant adds.
///
/// The simulated plant has strain and calls fromStrain(). A plant behind drivers (RosPlant) has
/// their wrenches and displacements, sensor/sensor_pipeline.h, and calls fromWrenches() with views
/// of the messages' arrays: that is the one conversion at the edge. Both fill SampleWindow of
/// requested windows from the same samples. Whether a block is fresh enough for a command is
/// decided by the plant's clock, guard/freshness.h.
class BlockPipeline {
 public:
  /// converter_step: of the converters of both sensors [V]. Without sensor_a its samples aren't
  /// read, and its wrench is 0.
  explicit BlockPipeline(double converter_step, Sensors sensors = Sensors::kBoth)
      : converter_step_(converter_step), sensors_of_cell_(sensors) {}

  /// sensor: 0 or 1, sensor_a or sensor_b.
  void setCalibration(std::size_t sensor, const Calibration& calibration);
  const std::optional<Calibration>& calibration(std::size_t sensor) const {
    return sensors_[sensor].calibration;
  }

  /// Displacements follow from sensor_b's wrench by this coupling. Null: from its calibration, or
  /// as its driver sends them. Throws InputError if its stiffness is singular.
  void setCoupling(const CouplingParameters* coupling);

  /// Every sensor of the cell has a calibration.
  bool calibrated() const;

  /// A block from moments of strain [V], with `period` between samples [s]. Needs the calibrations.
  PlantBlock fromStrain(const BlockMoments& a, const BlockMoments& b, bool saturated,
                        double period) const;

  /// A block from wrenches of the sensors and displacements of sensor_b. Nothing if one of these is
  /// empty or not finite.
  std::optional<PlantBlock> fromWrenches(const SensorSamples& a, const SensorSamples& b,
                                         const SensorSamples& displacements, double period) const;

  /// Displacement of the coupling from strain of sensor_b [V], in sensor_b axes [m], [rad].
  Vector6 displacement(const Vector6& volts_b) const {
    return displacementFromVolts(displacement_map_, volts_b);
  }

 private:
  struct Sensor {
    std::optional<Calibration> calibration;
    Matrix6 rounding = Matrix6::Zero();  ///< covariance of the wrench by the converter's rounding
  };

  PlantBlock join(const BlockMoments& a, const BlockMoments& b, double period) const;
  void updateDisplacementMap();

  double converter_step_;
  Sensors sensors_of_cell_;
  std::array<Sensor, 2> sensors_;
  Calibration displacement_map_;  // of sensor_b
  std::optional<CouplingParameters> coupling_;
  Matrix6 compliance_ = Matrix6::Zero();  // of coupling_
};

}  // namespace assembly_cell
