// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Inverse of couplingStiffness(): displacement by the wrench on it. [m/N], [rad/N], [m/(N·m)],
/// [rad/(N·m)]. Throws InputError when the stiffness is singular.
Matrix6 couplingCompliance(const CouplingParameters& coupling);

}  // namespace assembly_cell
