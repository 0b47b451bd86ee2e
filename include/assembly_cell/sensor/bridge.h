// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// One elastic hinge of the six in series and its strain channel (design: thesis chapter 11).
struct Hinge {
  Eigen::Vector3d position;   ///< r: a point of the hinge line, datum axes from O_D [m]
  Eigen::Vector3d direction;  ///< u: unit vector of the hinge line
  double strain_per_moment;   ///< c [1/(N m)]
  double gain;                ///< [V] per unit strain
  double offset;              ///< [V]
  double stiffness;           ///< κ [N·m/rad]
  double curvature;           ///< q: strain ε (1 + q ε/10⁻³)
  double zero_drift;          ///< [V/K]
};

/// Ground truth of a sensor's strain bridge: six channels.
/// Frame: the sensor frame; its axes are the datum axes, its origin the reference point.
struct Bridge {
  std::array<Hinge, 6> hinges;
  Eigen::Vector3d reference_point = Eigen::Vector3d::Constant(0.030);  ///< in datum axes [m]
  int bits = 16;                                                       ///< 10, 16 or 24
  double full_scale = 5.0;                                             ///< ± [V]
  double noise = 0.5e-3;                                               ///< white, rms [V]
  double temperature = 20.0;                                           ///< [°C], drift from 20
  double nonlinearity = 0.0;  ///< 0: small loads; 1: each hinge turns and its gauges curve
};

/// Throws InputError that begins with `what`, names the value and what to give, for bits other than
/// 10, 16, 24.
void checkBits(int bits, const std::string& what);

/// The two bridges of the cell; throws InputError for bits other than 10, 16, 24 or noise < 0.
Bridge bridgeA(int bits, double noise);
Bridge bridgeB(int bits, double noise);

/// The drawing's bridge without the scatter of manufacture: what is known before calibration.
Bridge nominalBridge();

/// V = C w: channel voltages [V] per wrench (force, torque) about the sensor frame's origin, small
/// loads.
Matrix6 strainMatrix(const Bridge& bridge);

/// The carrier's corner O_C at rest, datum axes from O_D [m].
inline const Eigen::Vector3d kCarrierAtRest(0.060, 0.0, 0.0);

/// What a load does to the sensor.
struct BridgeState {
  Vector6 volts;  ///< offsets, noise and temperature apart [V]
  Pose X_DC;      ///< carrier in datum axes from O_D, R = I and (60, 0, 0) mm at rest
};

/// The serial hinges (order from the datum 1 3 5 2 4 6) under wrench w in the sensor frame, which
/// is that of the datum: the hinge lines are carried by the hinges before them. With nonlinearity 0
/// the volts are strainMatrix(bridge) · w.
BridgeState deflect(const Bridge& bridge, const Vector6& w);

/// One conversion of the six channels.
struct StrainSample {
  Vector6 volts = Vector6::Zero();
  std::uint8_t saturated = 0;  ///< bit k: channel k at an end code
};

/// Deterministic generator of standard normal numbers: the same seed gives the same bits
/// everywhere.
class NormalSource {
 public:
  explicit NormalSource(std::uint64_t seed) : engine_(seed) {}
  double operator()();
  /// Sum of the squares of `count` normal numbers, 1 or more.
  double sumOfSquares(int count);

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

/// Transduction with noise, rounding to the converter's codes and saturation. `strain_matrix` is
/// strainMatrix(bridge), computed once. w: wrench in the sensor frame. No allocation.
StrainSample convert(const Bridge& bridge, const Matrix6& strain_matrix, const Vector6& w,
                     NormalSource& normal);

/// convert() from the strain volts of deflect().
StrainSample convertVolts(const Bridge& bridge, const Vector6& volts, NormalSource& normal);

/// Input of the converters by strain volts without noise: with the bridge's offsets at its
/// temperature [V].
Vector6 converterInput(const Bridge& bridge, const Vector6& volts);

/// Step of the converters [V].
double resolution(const Bridge& bridge);

/// Variance of a sample by noise and rounding [V²].
double sampleVariance(const Bridge& bridge);

}  // namespace assembly_cell
