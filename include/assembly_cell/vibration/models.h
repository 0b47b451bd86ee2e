// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/math/closed_form.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/walking.h"

namespace assembly_cell {

/// By name, null where there is none. `locus` has the parameter `model` alone, which names one of
/// the table of locusModel (`isotropic`, ...); `map` is evaluated by designCase and designPoint.
const ClosedForm* vibrationModel(const std::string& name);
const ClosedForm* locusModel(const std::string& name);

DesignCase designCase(const ModelParameters& p);  ///< of `map`
WalkCase walkCase(const ModelParameters& p);      ///< of `walk`

}  // namespace assembly_cell
