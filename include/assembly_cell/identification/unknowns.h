// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

// The unknowns of an identification: deviations of a mechanism from its drawing, with their prior.
// SI units.

/// Deviations of exciter and carrier.
struct DriveErrors {
  double gain = 1.0;   ///< of the exciter's amplitude, mean of both axes of its ellipse [-]
  double delay = 0.0;  ///< of the force after the commanded angle [s]
  /// Ellipse: (1, -i) becomes (1, -i) + [[p, q], [q, -p]] (1, -i) / 2; p = e cos 2φ, q = e sin 2φ
  /// with e the difference of the axes over their mean and φ the azimuth of the major axis.
  Eigen::Vector2d ellipse = Eigen::Vector2d::Zero();
  double compliance = 0.0;  ///< of the carrier behind its encoders, all axes, lag 10 ms [m/N]
};

/// A mechanism with its drive.
struct MechanismModel {
  Mechanism mechanism;
  DriveErrors drive;
};

/// One unknown: value = nominal · exp(mean + sd z), or nominal + mean + sd z, with z standard
/// normal a priori.
struct Unknown {
  std::string name;  ///< key path of the scenario, or of a mismatch file
  bool factor = true;
  double mean = 0.0;
  double sd = 0.0;
};

/// Places in the list.
enum UnknownIndex {
  kStiffness = 0,  ///< six rows: z, x, y, about z, x, y; k26 and k35 with the root of their rows
  kDamping = 6,    ///< six rows
  kPegMass = 12,   ///< inertias with it
  kCouplingHeight,
  kExciterHeight,
  kCarrierMass,       ///< inertia with it
  kCarrierStiffness,  ///< x, y, yaw
  kFriction = kCarrierStiffness + 3,
  kExciterGain,
  kExciterDelay,
  kEllipse,  ///< p, q
  kCompliance = kEllipse + 2,
  kUnknowns
};
using UnknownVector = Eigen::Matrix<double, kUnknowns, 1>;
using UnknownMatrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;

/// All unknowns with the spreads of a cell as drawn (config/mismatch/level_2.yaml), a uniform draw
/// by its standard deviation; `scale` times them.
std::vector<Unknown> unknownsAsDrawn(double scale = 1.0);

/// The model at z, in units of the prior's standard deviations from its means.
MechanismModel modelAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns,
                       const UnknownVector& z);

/// Value of unknown i at z, in its own unit (a factor for friction and the exciter's gain).
double valueAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns, int i, double z);
/// And its standard deviation for that of z.
double sdAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns, int i, double z,
            double sd);
/// z that a model has: inverse of modelAt.
UnknownVector unknownsOf(const Mechanism& nominal, const std::vector<Unknown>& unknowns,
                         const MechanismModel& model);

}  // namespace assembly_cell
