// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/align/align.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell {

/// Fills in what an alignment and its parameters determine: duration, strategy, result, failure,
/// text, curve, estimates, and the settings that differ from the default.
void describe(const AlignResult& result, const AlignParameters& parameters, Run& run);

/// Adds the event that a progress report states, such as a retry after a jam; most state none.
void addEvent(const AlignProgress& progress, Run& run);

}  // namespace assembly_cell
