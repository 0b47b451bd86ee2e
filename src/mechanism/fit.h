// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Reads the key `fit` of a hole, a fit by ISO 286, and sets the tolerances of both radii, which
/// have been read. Radii that are equal are the nominal one and become the middle of their zones.
/// Throws InputError for a fit that doesn't exist and for radii that are in no zones of it.
void readFit(yaml::Section& in, HoleParameters& hole, PegParameters& peg);

}  // namespace assembly_cell
