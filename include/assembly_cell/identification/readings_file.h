// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/identification/fit.h"

namespace assembly_cell {

/// Measured and fitted vibrations, a CSV file with a header: place (-1 hanging), frequency
/// [rad/s], direction, amplitude [N], held_out, then real and imaginary parts of the six wrench
/// phasors, measured (fx_re …) and fitted (fit_fx_re …). Throws InputError when it can't be
/// written.
void saveReadings(const IdentificationData& data, const Identification& found,
                  const std::string& path);

}  // namespace assembly_cell
