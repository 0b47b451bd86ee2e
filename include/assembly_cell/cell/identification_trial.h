// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/identification/arm_response.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// Ground truth of the unknowns.
MechanismModel trueModel(const Scenario& truth);

/// Rms over all directions of what a contact's direction is wrong by when it is read at the
/// operating point by what is known of the mechanism, the sensor exact [rad].
double directionBias(const MechanismModel& truth, const KnownMechanism& known);

/// One simulated identification with its evaluation by the ground truth.
struct IdentificationTrial {
  IdentificationData data;
  Identification found;
  UnknownVector truth = UnknownVector::Zero();                 ///< as Identification::z
  double direction_bias = 0.0, direction_bias_as_drawn = 0.0;  ///< [rad]
  double fit_time = 0.0;                                       ///< of computing [s]
};

/// Identifies in simulation from `start`; `nominal` is the drawing. A plant or a contact that stops
/// it is a refusal with its reason. Throws InputError.
IdentificationTrial tryIdentification(const Scenario& start, const Mechanism& nominal,
                                      const CellParameters& cell, const IdentificationPlan& plan,
                                      const IdentificationPrior& prior);

/// One simulated measurement of the arm's response with its ground truth.
struct ArmTrial {
  ArmIdentification found;
  std::string refusal;  ///< why there is none; empty: there is
  ArmResponse truth;    ///< of the same cell without noise, by ramps of the command to and fro
};

/// Measures the response of the carrier, or of an arm that carries it (see CellParameters), from
/// `start`. Throws InputError.
ArmTrial tryArmIdentification(const Scenario& start, const Mechanism& nominal,
                              const CellParameters& cell, const ArmPlan& plan);

}  // namespace assembly_cell
