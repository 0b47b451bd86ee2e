// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// A dial gauge fixed to the datum: its tip is at point + reading · axis on face `face` of the
/// carrier. Frame D1: axes of the datum, origin near the carrier's corner O_C at rest.
struct DialGauge {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< reading 0 [m]
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< of motion, unit
  int face = 0;                                     ///< 0 … 2
};

/// A plane of the carrier: normal · x = offset in carrier axes from O_C. Ideal: the axis, 0.
struct CarrierFace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();  ///< unit
  double offset = 0.0;                                ///< [m]
};

/// Gauges and faces. The default is the arrangement of thesis 11.5: six gauges in pairs at ±D, in
/// the order G11 G12 G21 G22 G31 G32, on orthogonal faces.
struct GaugeLayout {
  std::vector<DialGauge> gauges;
  std::array<CarrierFace, 3> faces;
};

/// Thesis 11.5 with pairs at ±`half_distance` [m].
GaugeLayout thesisGauges(double half_distance = 0.025);

/// Pose of the carrier from gauges.
struct GaugePose {
  Pose X_DC;                             ///< carrier in D1
  Matrix6 covariance = Matrix6::Zero();  ///< of (dp, dφ) in axes of D1
  double chi2 = 0.0;                     ///< of the residuals; 0 with six gauges
  int dof = 0;                           ///< gauges − 6
  int suspect = -1;                      ///< gauge that a fault test names, −1: none
};

/// Readings of the gauges for a pose of the carrier. Throws InputError for a gauge along its face.
std::vector<double> gaugeReadings(const GaugeLayout& layout, const Pose& X_DC);

/// Least squares for six or more gauges and calibrated faces, with covariance for gauges of
/// standard deviation `sigma` [m]. Starts from the identity. With seven or more,
/// when p(χ²) < 10⁻³, `suspect` is the gauge whose removal leaves the best fit (with exactly seven
/// all removals fit: then it is the largest normalised residual and only a hint). Throws
/// InputError: sizes, rank below 6, no convergence.
GaugePose poseFromGauges(const GaugeLayout& layout, const std::vector<double>& readings,
                         double sigma);

}  // namespace assembly_cell
