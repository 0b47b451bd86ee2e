// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/base/number_field.h"
#include "assembly_cell/ros/bridge/parameters.h"

namespace assembly_cell::ros_bridge {

/// Those that the node's parameters have; the others keep what they are. Throws InputError.
void readFields(Parameters& parameters, const std::vector<NumberField>& fields);

}  // namespace assembly_cell::ros_bridge
