// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// Result of a check of a mechanism on the hanging peg.
struct MechanismCheck {
  bool agrees = false;
  double chi2 = 0.0, p = 1.0;
  int dof = 0;
  std::string message;  ///< if not: the parameter that deviates most, and by how much
};

constexpr double kCheckLevel = 1e-4;  ///< p below which the mechanism is refuted

/// χ² test of steps of a stepped sine on the hanging peg against a mechanism and its covariance;
/// errors of the sensor as in `prior`. The message names the parameter whose change alone explains
/// most of χ².
MechanismCheck evaluateMechanism(const KnownMechanism& known,
                                 const std::vector<VibrationReading>& readings,
                                 const IdentificationPrior& prior = {});

/// Parameters of a strategy with ellipse and compliance of the drive; gain and delay are
/// compensated by the plant.
AlignParameters withDrive(AlignParameters parameters, const DriveErrors& drive);

/// A check before the first contact, about a second: the hanging peg at two frequencies, one in
/// each direction. The exciter is off at the end. Throws AlignError, PlantError.
MechanismCheck checkMechanism(Plant& plant, const KnownMechanism& known);

}  // namespace assembly_cell
