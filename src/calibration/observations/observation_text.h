// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <set>
#include <string>

#include "assembly_cell/calibration/observations/observation.h"

namespace assembly_cell {

constexpr const char* kObservationFormat = "assembly_cell observations 1";
constexpr double kUnitTolerance = 1e-6;  // of directions and rotations as written by people

/// Keys of an observation's line that only this kind has (docs/how_to/calibration.md).
const std::set<std::string>& keysOf(ObservationKind kind);

}  // namespace assembly_cell
