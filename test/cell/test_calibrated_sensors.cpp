// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Sensors of a cell calibrated on the bench: what their calibrations say of their own errors
// against the errors that they make, by the bridges that the bench hides.
#include "assembly_cell/cell/calibrated_sensors.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {
namespace {

// the seed draws matrices that are off by 1 %
CellParameters offCell(std::uint64_t seed) {
  const Mismatch off = parseMismatch(
      "sensor_a: {matrix: {normal: 0.01}}\nsensor_b: {matrix: {normal: 0.01}}", "test");
  CellParameters cell;
  cell.seed = seed;
  cell.truth = drawTruth(off, seed).cell;
  return cell;
}

// E of w' = (I + E) w, w' by the calibration of the volts that w makes
Matrix6 errorOf(const CellParameters& cell, const Calibration& c, Side side) {
  const Bridge bridge = (side == Side::kA ? bridgeA : bridgeB)(cell.bits, cell.noise);
  const Matrix6 volts =
      strainMatrix(bridge) * (side == Side::kA ? cell.truth.sensor_a : cell.truth.sensor_b).gain();
  return c.volts_to_wrench * volts - Matrix6::Identity();
}

TEST(CalibratedSensors, SayHowWrongTheyAre) {
  constexpr int kCells = 60;
  for (const int samples : {1, 20}) {
    double squared[2] = {0.0, 0.0};
    for (int i = 0; i < kCells; ++i) {
      const CellParameters cell = offCell(static_cast<std::uint64_t>(7100 + i));
      const PerSide<Calibration> sensors = calibratedSensors(cell, samples);
      for (const Side side : kSides) {
        const Matrix6 rows = errorOf(cell, sensors[side], side).transpose();
        // the bench found the 1 %
        const double most = rows.topLeftCorner(3, 3).cwiseAbs().maxCoeff();
        EXPECT_LT(most, 5e-3) << i;
        const Eigen::VectorXd e = rows.reshaped();
        squared[side == Side::kB] += e.dot(gainCovariance(sensors[side]).ldlt().solve(e));
      }
    }
    // χ² of 36 entries, within four standard errors
    for (const double sum : squared) {
      EXPECT_NEAR(sum / kCells, 36.0, 4.0 * std::sqrt(2.0 * 36.0 / kCells)) << samples;
    }
  }
}

TEST(CalibratedSensors, AreDrawnByTheSeed) {
  CellParameters cell;
  const Matrix6 first = calibratedSensors(cell, 1).a.volts_to_wrench;
  EXPECT_EQ(calibratedSensors(cell, 1).a.volts_to_wrench, first);
  cell.seed = 2;
  EXPECT_NE(calibratedSensors(cell, 1).a.volts_to_wrench, first);
  EXPECT_THROW(calibratedSensors(cell, 0), InputError);
  // a linear map is refused on bridges as built, at each repetition
  cell.bridge_nonlinearity = 1.0;
  EXPECT_THROW(calibratedSensors(cell, 20), InputError);
}

}  // namespace
}  // namespace assembly_cell
