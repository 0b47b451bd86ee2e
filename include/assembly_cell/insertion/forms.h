// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/math/closed_form.h"

namespace assembly_cell {

/// The closed forms of insertion/ by name, null where there is none.
const ClosedForm* insertionForm(const std::string& name);

}  // namespace assembly_cell
