// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// A goal before the one that counts, drawn from `seed`: a press with up to 40 N, or an alignment,
/// cut off after up to 30 s. As when its node dies, the exciter is off then, and the carrier stays
/// where it is: the peg may be pressed, tilted, over the hole or in it. Every other cut frees the
/// peg, as a cancel does.
void leaveFirstGoal(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                    std::uint64_t seed);

}  // namespace assembly_cell
