// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/search/search_state.h"

namespace assembly_cell {

// The strategies. All throw PlantError when the plant fails.

/// Locus directions of single contacts round the edge (thesis Fig 9.14).
AlignResult singleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters, const ProgressCallback& progress);
/// Locus direction of a double contact, then both single ones (thesis Fig 9.16).
AlignResult doubleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters, const ProgressCallback& progress);
/// double_contact, and where that fails single_contact from the start again.
AlignResult vibratory(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const ProgressCallback& progress);
/// Positions where the tilted peg touches face, rim and wall.
AlignResult touchSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                        const ProgressCallback& progress);
/// Pose of the peg in the hole from the wrenches of both sensors (thesis chapter 10).
AlignResult twinForce(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const ProgressCallback& progress);
/// Level with the face, then along a spiral under constant force until the peg drops: a baseline.
AlignResult spiralSearch(Plant& plant, const Mechanism& mechanism,
                         const AlignParameters& parameters, const ProgressCallback& progress);
/// Shaken and lowered, without measuring on the path: the other baseline (thesis Part 1).
AlignResult passiveAssembly(Plant& plant, const Mechanism& mechanism,
                            const AlignParameters& parameters, const ProgressCallback& progress);
/// touch, and where that fails twin_force, then vibratory, each from the start again.
AlignResult autoSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                       const ProgressCallback& progress);

}  // namespace assembly_cell
