// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/cell/simulated_cell.h"

namespace assembly_cell {

/// Calibrations of both sensors by plan `recommended` on the simulated bench, `samples` readings
/// averaged a test, errors of the bench and of the readings drawn by the cell's seed. The bench has
/// the cell's bridges with the matrices of its ground truth; frames, drift and hum are the cell's
/// own. A calibration that the checks refuse is repeated, four times at most. Throws InputError if
/// they refuse the fifth, too, or for samples below 1.
PerSide<Calibration> calibratedSensors(const CellParameters& cell, int samples);

}  // namespace assembly_cell
