// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace assembly_cell {

/// Force sensors of a cell: sensor_a below the hole and sensor_b above the peg, or sensor_b alone.
enum class Sensors { kBoth, kB };

/// Their names in settings, in the order of Sensors.
inline std::vector<std::string> sensorChoices() { return {"both", "b"}; }

/// The first of the sensors that are there: 0 is sensor_a, 1 sensor_b.
inline std::size_t firstSensor(Sensors sensors) { return sensors == Sensors::kB ? 1 : 0; }

}  // namespace assembly_cell
