// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>

#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// Step of a strategy [s]: its waits, speeds and thresholds are made for blocks of this length.
inline constexpr double kStepTime = 0.02;

/// Carries out the command and returns the next block; `first`: of this step.
using NextBlock = std::function<PlantBlock(const PlantCommand& command, bool first)>;

/// A step of a plant whose blocks may be shorter: carries out the command, then puts blocks
/// together until they are kStepTime long. Means and covariances are those of all their samples. A
/// block whose force is beyond command.alarm, and beyond its own noise, ends the step at once and
/// is returned alone. A block as long as a step is returned as it is.
PlantBlock nextStep(const PlantCommand& command, const NextBlock& next);

}  // namespace assembly_cell
