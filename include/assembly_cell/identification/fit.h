// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/identification/measure.h"

namespace assembly_cell {

/// Prior standard deviations of an identification. The defaults are those of a cell as drawn
/// (config/mismatch/level_2.yaml).
struct IdentificationPrior {
  std::vector<Unknown> unknowns = unknownsAsDrawn();
  // sensor_b against its calibration: w' = (I + E) w in a rotated and offset frame
  double sensor_matrix = 0.01;      ///< every entry of E, torques against forces at 30 mm
  double sensor_rotation = 0.0098;  ///< of the frame about each axis [rad]
  double sensor_offset = 2.9e-4;    ///< along each axis [m]
  double sensor_drift = 0.6;        ///< of each force, torques at 30 mm [N/min]
  double sensor_walk = 0.05;        ///< of a zero, torques at 30 mm [N per root minute]
  double upright = 0.03;            ///< of the carrier's base against gravity and face [rad]
  double aside = 0.01;              ///< PressedState::aside [rad]
  // model errors relative to the largest force of a reading, torques at 30 mm
  double hanging_model = 1.5e-4;
  double pressed_model = 7e-5;
};

/// χ² test of one reading that was left out of the fit.
struct HeldOutGroup {
  std::string name;  ///< "hanging 690 rad/s clockwise"
  double chi2 = 0.0, p = 1.0;
  int dof = 0;
};

/// Two unknowns that the data don't separate.
struct CorrelatedPair {
  int first = 0, second = 0;  ///< indices in the list of unknowns
  double correlation = 0.0;
};

/// Result of an identification.
struct Identification {
  std::vector<Unknown> unknowns;            ///< with the prior
  UnknownVector z = UnknownVector::Zero();  ///< most probable, in deviations of the prior
  UnknownMatrix covariance = UnknownMatrix::Identity();  ///< of z, nuisance parameters marginalised
  MechanismModel model;                                  ///< at z
  bool accepted = false;
  std::string verdict;         ///< "accepted", or the disagreement
  double chi2 = 0.0, p = 1.0;  ///< of the data left out
  int dof = 0;
  double fit_chi2 = 0.0;    ///< of the data fitted and the prior
  int fit_dof = 0;          ///< number of the data fitted
  double condition = 0.0;   ///< largest over smallest information, in units of the prior
  std::vector<int> unseen;  ///< unobserved unknowns: posterior over prior deviation above kUnseen
  std::vector<CorrelatedPair> correlated;  ///< above kCorrelated
  std::vector<HeldOutGroup> groups;        ///< each reading left out
  std::vector<WrenchPhasor> fitted;  ///< model at z of every vibration, sensor errors included
  std::vector<std::string> notes;
  int iterations = 0;

  double sd(int i) const { return std::sqrt(covariance(i, i)); }
};

constexpr double kUnseen =
    0.7;  ///< ratio of deviations above which an unknown counts as unobserved
constexpr double kCorrelated = 0.8;
constexpr double kHeldOutLevel = 1e-3;  ///< p below which the data left out disagree

/// Maximum a posteriori by Levenberg–Marquardt with the sensor's errors, zeros, tilts and the
/// contact's position as nuisance parameters. Throws InputError when there is nothing to fit.
Identification identify(const Mechanism& nominal, const IdentificationData& data,
                        const IdentificationPrior& prior = {});

/// Prior covariance, 36 × 36, of the sensor's error matrix (column-major): reading = (I + error) w.
Eigen::MatrixXd sensorMapCovariance(const IdentificationPrior& prior);

}  // namespace assembly_cell
