// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/identification/measure.h"

namespace assembly_cell {

/// What is known before anything is measured; standard deviations. The defaults are those of a cell
/// as drawn (config/mismatch/level_2.yaml).
struct IdentificationPrior {
  std::vector<Unknown> unknowns = unknownsAsDrawn();
  // sensor_b against its calibration: w' = (I + E) w in a frame that is turned and offset
  double sensor_matrix = 0.01;      ///< every entry of E, torques against forces at 30 mm
  double sensor_rotation = 0.0098;  ///< about each axis [rad]
  double sensor_offset = 2.9e-4;    ///< along each axis [m]
  double sensor_drift = 0.6;        ///< of each force, torques at 30 mm [N/min]
  double sensor_walk = 0.05;        ///< of a zero, torques at 30 mm [N per root minute]
  double upright = 0.03;            ///< of the carrier's base against gravity and face [rad]
  double aside = 0.01;              ///< PressedState::aside [rad]
  // what the model leaves out, of the largest force of a reading, torques at 30 mm
  double hanging_model = 1.5e-4;
  double pressed_model = 7e-5;
};

/// What the data left out of the fit say.
struct HeldOutGroup {
  std::string name;  ///< "hanging 690 rad/s clockwise"
  double chi2 = 0.0, p = 1.0;
  int dof = 0;
};

/// Two unknowns that the data tell together only.
struct CorrelatedPair {
  int first = 0, second = 0;  ///< places in the list of unknowns
  double correlation = 0.0;
};

/// What an identification found.
struct Identification {
  std::vector<Unknown> unknowns;            ///< with the prior
  UnknownVector z = UnknownVector::Zero();  ///< most probable, in deviations of the prior
  UnknownMatrix covariance = UnknownMatrix::Identity();  ///< of z, all nuisance included
  MechanismModel model;                                  ///< at z
  bool accepted = false;
  std::string verdict;         ///< "accepted", or what disagrees
  double chi2 = 0.0, p = 1.0;  ///< of the data left out
  int dof = 0;
  double fit_chi2 = 0.0;    ///< of the data fitted and the prior
  int fit_dof = 0;          ///< number of the data fitted
  double condition = 0.0;   ///< greatest over smallest information, in units of the prior
  std::vector<int> unseen;  ///< posterior over prior deviation above kUnseen
  std::vector<CorrelatedPair> correlated;  ///< above kCorrelated
  std::vector<HeldOutGroup> groups;        ///< each reading left out
  std::vector<WrenchPhasor> fitted;        ///< of every vibration, the sensor's errors included
  std::vector<std::string> notes;
  int iterations = 0;

  double sd(int i) const { return std::sqrt(covariance(i, i)); }
};

constexpr double kUnseen = 0.7;  ///< ratio of deviations that counts as not seen
constexpr double kCorrelated = 0.8;
constexpr double kHeldOutLevel = 1e-3;  ///< p below which the data left out disagree

/// Maximum a posteriori by Gauss–Newton with the sensor's errors, zeros, tilts and the contact's
/// place as nuisance. Throws InputError when there is nothing to fit.
Identification identify(const Mechanism& nominal, const IdentificationData& data,
                        const IdentificationPrior& prior = {});

/// Prior covariance of the matrix that a sensor's reading is multiplied with less the identity,
/// column after column.
Eigen::MatrixXd sensorMapCovariance(const IdentificationPrior& prior);

}  // namespace assembly_cell
