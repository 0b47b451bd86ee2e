// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>

#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// What a strategy takes at a time: its waits, speeds and thresholds are made for blocks of such a
/// length [s].
inline constexpr double kStepTime = 0.02;

/// Carries out the command and gives the next block; `first`: of this step.
using NextBlock = std::function<PlantBlock(const PlantCommand& command, bool first)>;

/// A step of a plant whose blocks may be shorter: carries out the command, then puts blocks
/// together until they are kStepTime long. Means and covariances are those of all their samples. A
/// block whose force is beyond command.alarm, and beyond its own noise, ends the step at once and
/// is given alone: what needs an answer doesn't wait for the rest. A block as long as a step is
/// given as it is.
PlantBlock nextStep(const PlantCommand& command, const NextBlock& next);

}  // namespace assembly_cell
