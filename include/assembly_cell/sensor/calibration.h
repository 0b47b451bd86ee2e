// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <limits>
#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

constexpr int kStrainProducts = 21;
/// Serial number of a sensor that has no calibration and reports none.
inline constexpr const char* kUnknownSerial = "unknown";
using Vector21 = Eigen::Matrix<double, kStrainProducts, 1>;
using Matrix6x21 = Eigen::Matrix<double, 6, kStrainProducts>;

/// Products of two strains: s1s1 s1s2 … s1s6 s2s2 s2s3 … s6s6.
inline Vector21 strainProducts(const Vector6& s) {
  Vector21 products;
  for (int i = 0, k = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) products[k++] = s[i] * s[j];
  }
  return products;
}

/// How well a map fits what it was made from.
struct FitStatistics {
  double chi2 = 0.0;
  int dof = 0;                             ///< 0: nothing is known
  double p = 1.0;                          ///< of χ²
  Vector6 residual_rms = Vector6::Zero();  ///< by axis
  Vector6 predicted_sd = Vector6::Zero();  ///< of the map alone over rated loads
};

/// What turns volts into a wrench and a displacement: linear, or complete quadratic.
/// Coefficients of a row: six of the strains, then (quadratic) 21 of strainProducts().
struct Calibration {
  std::string id;
  std::string serial_number;
  std::string date;
  Matrix6 volts_to_wrench = Matrix6::Zero();        ///< S: [N/V], [N·m/V], sensor frame
  Matrix6 volts_to_displacement = Matrix6::Zero();  ///< T: [m/V], [rad/V]; zero where rigid
  Vector6 zero_volts = Vector6::Zero();             ///< reading of the unloaded sensor [V]

  bool quadratic_wrench = false;                          ///< wrench_products count
  bool quadratic_displacement = false;                    ///< displacement_products count
  Matrix6x21 wrench_products = Matrix6x21::Zero();        ///< [N/V²], [N·m/V²]
  Matrix6x21 displacement_products = Matrix6x21::Zero();  ///< [m/V²], [rad/V²]

  double temperature =
      std::numeric_limits<double>::quiet_NaN();  ///< at calibration [°C]; NaN: unknown
  Vector6 noise = Vector6::Zero();               ///< of one sample, quantisation included, rms [V]
  Vector6 wrench_range = Vector6::Zero();        ///< largest |strain| of the tests [V]; 0: unknown
  Vector6 displacement_range = Vector6::Zero();
  FitStatistics wrench_fit, displacement_fit;
  std::string observations_digest;  ///< what it was made from; empty: by design

  /// Covariance of the coefficients, row after row: 36 × 36 or 162 × 162; 0 × 0: unknown.
  Eigen::MatrixXd wrench_covariance;
  /// Covariance of the coefficients of one row, for unit variance of an output: 6 × 6 or 27 × 27;
  /// 0 × 0: unknown. Rows are independent; that of row i is this times displacement_variance[i].
  Eigen::MatrixXd displacement_covariance;
  Vector6 displacement_variance = Vector6::Zero();  ///< [m²], [rad²]
};

/// w = S (v − v0), force before torque, with the products when quadratic.
inline Vector6 wrenchFromVolts(const Calibration& c, const Vector6& volts) {
  if (!c.quadratic_wrench) return c.volts_to_wrench * (volts - c.zero_volts);
  const Vector6 s = volts - c.zero_volts;
  return c.volts_to_wrench * s + c.wrench_products * strainProducts(s);
}

/// d = T (v − v0): x y z [m], rotation vector [rad] of the coupling point relative to rest, with
/// the products when quadratic.
inline Vector6 displacementFromVolts(const Calibration& c, const Vector6& volts) {
  if (!c.quadratic_displacement) return c.volts_to_displacement * (volts - c.zero_volts);
  const Vector6 s = volts - c.zero_volts;
  return c.volts_to_displacement * s + c.displacement_products * strainProducts(s);
}

/// The calibration with the displacement map of a sensor that is a coupling of this stiffness:
/// its static compliance times the wrench. [N/m], [N/rad], [N·m/m], [N·m/rad]. Throws InputError if
/// the stiffness is singular.
Calibration withDisplacement(Calibration calibration, const Matrix6& stiffness);

/// Covariance of a wrench: that of the map (zero when unknown) and that of the strains,
/// (I⊗b)ᵀ P (I⊗b) + J Σ_v Jᵀ with J = dw/dv. For publishing rates, not for every sample.
Matrix6 wrenchCovariance(const Calibration& c, const Vector6& volts,
                         const Matrix6& volts_covariance);

/// Covariance of the gain error E of the map, w' = (I + E) w with w' the map's value of a wrench w:
/// covariance of the entries of E, row after row, SI units, 36 × 36; 0 × 0: unknown. Of a
/// quadratic map that of its linear part.
Eigen::MatrixXd gainCovariance(const Calibration& c);

/// Likewise of a displacement.
Matrix6 displacementCovariance(const Calibration& c, const Vector6& volts,
                               const Matrix6& volts_covariance);

/// A bit per channel beyond 1.1 times the range of the tests; 0 where the range is unknown.
unsigned outsideWrenchRange(const Calibration& c, const Vector6& volts);

/// "2, 5" for the bits 1 and 4, "none" for 0.
std::string channelText(unsigned channels);

/// Throws InputError, one line beginning with `source` and naming the item: no id or serial number,
/// a non-finite number, a singular volts_to_wrench, a covariance of the wrong size, not symmetric
/// or with a negative variance.
void checkCalibration(const Calibration& calibration, const std::string& source);

/// CRC-32 over strings and numbers (shortest text that reads back), "crc32:" and eight hexadecimal
/// digits.
std::string calibrationChecksum(const Calibration& calibration);

/// Reads and checks a calibration file (matrices as {rows, cols, data}, checksum), of format 1
/// (linear, no statistics) or 2; or a calibration of ATI (ati_calibration.h). Throws InputError for
/// an unreadable, foreign, corrupt (checksum) or non-finite file.
Calibration loadCalibration(const std::string& path);

/// Writes atomically: temporary file, fsync, rename. Throws InputError when it cannot.
void saveCalibration(const Calibration& calibration, const std::string& path);

}  // namespace assembly_cell
