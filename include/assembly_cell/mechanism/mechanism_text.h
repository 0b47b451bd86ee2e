// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// The mechanism's keys of a scenario or mechanism file, as YAML that loadMechanism() reads back to
/// the same numbers.
std::string mechanismText(const Mechanism& mechanism);

}  // namespace assembly_cell
