// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/locus/harmonic_fit.h"

namespace assembly_cell {

/// Harmonic fit of a wrench, 6 × n samples, force before torque [N], [N·m]; angle: of the exciter
/// at each sample [rad]. Its noise is that of the differences between consecutive samples: hum,
/// which is slow against the samples, counts little, and over whole periods of hum and exciter it
/// leaves the phasors alone. Throws InputError as fitHarmonic.
HarmonicFit fitVibration(const std::vector<double>& angle, const std::vector<double>& wrenches);

}  // namespace assembly_cell
