// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Residuals of an identification and their derivatives, all unknowns and nuisance in units of their
// prior standard deviations.
#pragma once

#include "assembly_cell/identification/fit.h"

namespace assembly_cell::identification {

// Indices in the vector of unknowns and nuisance parameters.
constexpr int kMap = kUnknowns, kGravity = kMap + 36, kFace = kGravity + 2, kZero = kFace + 2,
              kDrift = kZero + 6, kAside = kDrift + 6;

// Rows of one reading: whitened residual (data − model) and minus its derivative.
struct Rows {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
};

class Problem {
 public:
  Problem(const Mechanism& nominal, const IdentificationData& data,
          const IdentificationPrior& prior);

  int size() const { return kAside + 7 * places_; }
  // All readings that are, or are not, left out. `derivatives`: the Jacobian as well.
  Rows rows(const Eigen::VectorXd& z, bool held_out, bool derivatives) const;
  // One vibration.
  Rows rows(const Eigen::VectorXd& z, const VibrationReading& reading, bool derivatives) const;

  // Reading of the sensor predicted at z.
  WrenchPhasor fitted(const Eigen::VectorXd& z, const VibrationReading& reading) const;

 private:
  using Wave = Eigen::Matrix<double, 12, 1>;  // real parts, imaginary parts

  Rows rows(const Eigen::VectorXd& z, const PoseReading& reading, bool derivatives) const;
  Rows rowsOfPoses(const Eigen::VectorXd& z, bool derivatives) const;
  Rows rowsOfFriction(const Eigen::VectorXd& z, bool derivatives) const;
  MechanismModel model(const Eigen::VectorXd& z) const;
  Wave exactWave(const Eigen::VectorXd& z, const VibrationReading& reading) const;
  // of a contact that differs from what the map makes of the reading's
  Wave exactWave(const Eigen::VectorXd& z, const VibrationReading& reading,
                 const Vector6& contact) const;
  // what the zero of a place's contacts has walked, behind the leans of all
  int walkAt(int place) const { return kAside + places_ + 6 * place; }
  Vector6 seenContact(const Eigen::VectorXd& z, const VibrationReading& reading) const;
  // by what the reading's contact owes to map and drift
  void addContact(const Eigen::VectorXd& z, const VibrationReading& reading, const Wave& exact,
                  Eigen::MatrixXd& jacobian) const;
  Vector6 exactWeight(const Eigen::VectorXd& z, const PoseReading& reading) const;
  Matrix6 map(const Eigen::VectorXd& z) const;
  Eigen::Matrix<double, 6, 36> mapDerivative(const Vector6& wrench) const;

  const Mechanism& nominal_;
  const IdentificationData& data_;
  const IdentificationPrior& prior_;
  Eigen::Matrix<double, 36, 36> map_root_;
  int places_ = 0;
};

}  // namespace assembly_cell::identification
