// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "assembly_cell/calibration/common/gate.h"
#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// Strain to displacement of one sensor: x y z [m] and rotation vector [rad] of O_C from rest, 27
/// terms a row: strains and all their products (thesis 11.4 leaves those of different strains out).
struct DisplacementSolution {
  bool accepted = false;
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(6, 27);
  Eigen::MatrixXd unit_covariance =
      Eigen::MatrixXd::Zero(27, 27);  ///< of a row, output of variance 1
  Vector6 output_sd =
      Vector6::Zero();  ///< expected of one test, from gauges and strain noise [m], [rad]
  Vector6 residual_sd = Vector6::Zero();  ///< measured; 0 without degrees of freedom [m], [rad]
  Vector6 range = Vector6::Zero();        ///< largest |strain| of each channel in the tests [V]
  int tests = 0, rank = 0, dof = 0;       ///< dof of one output
  double condition = 0.0;                 ///< strains in parts of their range
  double chi2 = 0.0, p = 1.0;             ///< all six outputs
  std::string weak_direction;
  std::vector<std::string> dropped;  ///< "observation 3: channel 2 saturated"
  std::vector<Gate> gates;
  std::string message;
};

/// Least squares of the displacement tests of one side; `accepted` and `gates` state the quality.
DisplacementSolution solveDisplacement(const ObservationSet& set, Side side);

/// Matrices, covariance and range into a calibration. Throws InputError for one not accepted.
void applyDisplacement(const DisplacementSolution& solution, Calibration& calibration);

/// Central composite design, strains as fractions of the range: 32 corners of the half fraction at
/// 0.7, 12 axial points, 2 centres.
std::vector<Vector6> centralComposite();

}  // namespace assembly_cell
