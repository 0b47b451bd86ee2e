// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/math/closed_form.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/walking.h"

namespace assembly_cell {

/// Closed form by name, null if unknown. The only parameter of `locus` is `model`, a name from the
/// table of locusModel (`isotropic`, ...); `map` is evaluated by designCase and designPoint.
const ClosedForm* vibrationModel(const std::string& name);
const ClosedForm* locusModel(const std::string& name);

DesignCase designCase(const ModelParameters& p);  ///< parameters of `map`
WalkCase walkCase(const ModelParameters& p);      ///< parameters of `walk`

}  // namespace assembly_cell
