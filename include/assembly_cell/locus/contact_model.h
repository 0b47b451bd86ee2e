// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>

#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

// The estimator's linear model of the mechanism's small motion; independent of dynamics/.
//
// Phasors U stand for Re(U e^{ia}) with a the exciter's angle; a clockwise exciter is a negative
// rate of a. Axes are those of `hole`; an estimator without them uses the sensor's and
// leaves sensor_tilt at zero: all of alpha, P, N and tilt are then in sensor axes.

/// Excitation, contact and posture of a prediction.
struct OperatingPoint {
  double frequency = 0.0;          ///< exciter [rad/s]
  double amplitude = 0.0;          ///< exciter [N]
  int direction = 1;               ///< +1 anticlockwise from above
  double press = 0.0;              ///< static contact force on the peg along z [N]
  Eigen::Vector2d friction{0, 0};  ///< static contact force across z, left by pressing [N]
  Eigen::Vector2d tilt{0, 0};      ///< of the peg axis: rotation vector (x, y) from upright [rad]
  bool rolling = false;  ///< edge on plane: rolls along the edge, press r / tilt [N m/rad]
  Eigen::Vector2d sensor_tilt{0, 0};  ///< of the sensor's axes, as tilt [rad]
  Eigen::Vector2d ellipse{0, 0};      ///< of the exciter's force, see DriveErrors
  double compliance = 0.0;            ///< of the carrier behind its encoders, lag 10 ms [m/N]
};

/// Response with one point of the peg's edge held.
struct ContactResponse {
  std::complex<double> P, N;  ///< of the centre of mass, carrier's motion included [m]
  /// Deflection of the coupling by the sensor's static map (damping shows as displacement), sensor
  /// axes: x y z [m], rotation vector [rad].
  Eigen::Matrix<std::complex<double>, 6, 1> coupling;
  /// Force on the peg at the held point besides the press, hole axes [N]: it must stay within
  /// friction, or the contact slips.
  Eigen::Vector3cd contact;
};

/// Response with the contact in direction alpha: horizontal direction from the centre of the peg's
/// bottom edge [rad]. Throws InputError for an operating point without frequency or amplitude, or a
/// coupling without a static map (singular stiffness).
ContactResponse contactResponse(const Mechanism& mechanism, const OperatingPoint& point,
                                double alpha);

/// Frequency between the rocking resonances of an upright peg where |P| is smallest against |N| in
/// the mean over alpha [rad/s]: the recommended operating point (without damping P vanishes there).
/// Throws InputError if there is none.
double operatingFrequency(const Mechanism& mechanism, double press);

/// Contact direction from a measured locus by inverting contactResponse.
struct DirectionEstimate {
  double alpha = 0.0;  ///< best direction [rad] in [0, 2π)
  double alpha_opposite =
      0.0;              ///< the best in the other half turn: it explains P, N almost as well
  double weight = 0.5;  ///< posterior weight of alpha against alpha_opposite
  double sd = 0.0;      ///< [rad]; Cramér–Rao, widened by the misfit beyond the noise
  double misfit = 0.0;  ///< residual relative to the measured size
};

/// How a measured locus came from the coupling's deflection.
enum class LocusAxes {
  kHole,   ///< centreOfMassPhasors with the tilts and the static force of the operating point
  kSensor  ///< centreOfMassLocus without tilts: sensor axes taken as upright, as locus_estimator
           ///< does
};

/// Weighted least squares over P and N. alpha is in hole axes either way. Refuse a misfit that
/// noise cannot explain: then the model (mode, press, friction, amplitude) does not hold. Throws
/// InputError as contactResponse, and for a locus of size zero.
DirectionEstimate contactDirection(const Mechanism& mechanism, const OperatingPoint& point,
                                   const Locus& locus, LocusAxes axes = LocusAxes::kHole);

/// Orientation of peg and sensor, and static load on the sensor.
struct Posture {
  Eigen::Vector2d tilt = Eigen::Vector2d::Zero();         ///< as in OperatingPoint [rad]
  Eigen::Vector2d sensor_tilt = Eigen::Vector2d::Zero();  ///< [rad]
  /// Weight of the peg on the sensor, hole axes; its arm moves with the deflection, zero leaves the
  /// arm out. [N]
  Eigen::Vector3d static_force = Eigen::Vector3d::Zero();
  double compliance = 0.0;  ///< as in OperatingPoint [m/N]
};

/// Phasors of the centre of mass in the plane, x and y, from those of the coupling's deflection by
/// the sensor's static map (sensor axes). Undoes the damping in the sensor's wrench and
/// adds the carrier's own motion, which follows from the coupling's force. frequency: rate of the
/// exciter's angle, negative for a clockwise exciter [rad/s].
Eigen::Vector2cd centreOfMassPhasors(const Mechanism& mechanism, double frequency,
                                     const Eigen::Matrix<std::complex<double>, 6, 1>& coupling,
                                     const Posture& posture = {});

/// Locus of the centre of mass from a fit of the six displacements, with the noise of all six
/// carried over. frequency and tilts as in centreOfMassPhasors.
Locus centreOfMassLocus(const Mechanism& mechanism, double frequency, const HarmonicFit& fit,
                        const Eigen::Vector2d& tilt = Eigen::Vector2d::Zero(),
                        const Eigen::Vector2d& sensor_tilt = Eigen::Vector2d::Zero());

/// Static contact force on the peg [N] from the mean deflection (untared), sensor axes taken as
/// upright; z at least 0.
Eigen::Vector3d contactForceFromDeflection(const Mechanism& mechanism, const Vector6& deflection);

}  // namespace assembly_cell
