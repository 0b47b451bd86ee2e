// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/math/closed_form.h"

namespace assembly_cell {

/// Closed form of insertion/ by name, null if unknown.
const ClosedForm* insertionForm(const std::string& name);

}  // namespace assembly_cell
