// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell {

/// Force sensors of a cell: sensor_a below the hole and sensor_b above the peg, or sensor_b alone.
enum class Sensors { kBoth, kB };

/// Their names in settings, in the order of Sensors.
inline std::vector<std::string> sensorChoices() { return {"both", "b"}; }

}  // namespace assembly_cell
