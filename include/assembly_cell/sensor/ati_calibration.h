// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// Is it XML instead of a calibration file of this package?
bool isXml(const std::string& text);

/// A calibration of ATI (.cal, XML: FTSensor with Calibration and six UserAxis rows), by which the
/// voltages of the six gauges become a wrench in the frame of the file. Rows of Axis are scaled and
/// for ATI's own programs; they are not used. zero_volts is 0: zero the sensor. `source` begins
/// messages. Throws InputError for a document that is malformed or another one, a missing or bad
/// row, other than six gauges, unknown units, or a gain other than 1.
Calibration parseAtiCalibration(const std::string& xml, const std::string& source);

}  // namespace assembly_cell
