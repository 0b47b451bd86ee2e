// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// What a look at the hanging peg says of a mechanism.
struct MechanismCheck {
  bool agrees = false;
  double chi2 = 0.0, p = 1.0;
  int dof = 0;
  std::string message;  ///< where it does not: which number is off most, and by how much
};

constexpr double kCheckLevel = 1e-4;  ///< p below which a mechanism is contradicted

/// Judges steps of a stepped sine on the hanging peg by what is known of the mechanism, the
/// sensor's own errors as in `prior`. The message names the number whose change alone explains
/// most.
MechanismCheck judgeMechanism(const KnownMechanism& known,
                              const std::vector<VibrationReading>& readings,
                              const IdentificationPrior& prior = {});

/// What a strategy has to know of the drive besides gain and delay, which the plant makes up for.
AlignParameters withDrive(AlignParameters parameters, const DriveErrors& drive);

/// A check of about a second of shaking: the hanging peg at two frequencies, one either way,
/// before anything is pressed. Ends with the exciter off. Throws AlignError, PlantError.
MechanismCheck checkMechanism(Plant& plant, const KnownMechanism& known);

}  // namespace assembly_cell
