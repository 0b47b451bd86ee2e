// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/calibrated_sensors.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {

/// Where a run of `align` with this seed starts, within 15 mm and 2 degrees. [m], [rad]
struct RandomStart {
  explicit RandomStart(std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
    const double azimuth = 2 * M_PI * uniform(), off = 0.015 * std::sqrt(uniform());
    const double direction = 2 * M_PI * uniform(), angle = 0.0349 * uniform();
    offset = off * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
    tilt = angle * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  }
  Eigen::Vector2d offset, tilt;
};

/// Aligns in the default cell, 3 mm over the plane, with a truth drawn by the seed, which is the
/// sensors', too. The strategy knows the nominal cell. calibrate: see calibratedSensors(); 0: by
/// design.
inline AlignTrial tryMismatched(const Mismatch& mismatch, const Eigen::Vector2d& offset,
                                const Eigen::Vector2d& tilt, const std::string& strategy,
                                std::uint64_t seed, int calibrate = 0) {
  const Scenario cell =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  const Truth truth = drawTruth(mismatch, seed);
  CellParameters sensors;
  sensors.seed = seed;
  sensors.truth = truth.cell;
  if (calibrate > 0) {
    const PerSide<Calibration> calibrated = calibratedSensors(sensors, calibrate);
    sensors.calibration_a = calibrated.a;
    sensors.calibration_b = calibrated.b;
  }
  AlignParameters parameters;
  parameters.strategy = strategy;
  return tryAlignment(trueScenario(startAt(cell, offset, tilt, 0.003), truth, "test"),
                      cell.mechanism, sensors, parameters);
}

}  // namespace assembly_cell
