// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>

#include "assembly_cell/align/search/bore_entry.h"
#include "assembly_cell/align/search/light_touch.h"

namespace assembly_cell {

/// The parts of a search, which strategies combine, and what all searches have in common from the
/// start to the result.
struct Search {
  Search(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
         const ProgressCallback& progress);

  /// Waits until the peg hangs free and at rest; S is the carrier's frame there. True if the peg is
  /// in the hole already, by walls on all four sides. Then the hole's centre is known, its axis
  /// isn't.
  bool begin();

  /// Runs `find`, which calls begin() and puts the peg's edge into the hole, then the insertion.
  /// After a failure the peg is freed. `summarise` adds the estimate of the hole to the result, if
  /// there is one. An AlignError becomes the result's failure. Throws PlantError.
  AlignResult run(const std::function<void()>& find,
                  const std::function<void(AlignResult&)>& summarise);

  SearchState state;
  Retreat retreat;
  LightTouch touch;
  BoreInsertion insertion;
  BoreEntry entry;

 private:
  AlignResult findAndLeave(const std::function<void()>& find);
  void leave();
};

/// Centre of the hole's estimate relative to the peg's bottom centre at the start, in axes of the
/// hole's plane [m].
Eigen::Vector2d holeOffset(const SearchState& state);

/// Writes the estimate of the hole into a result.
void summariseHole(const SearchState& state, AlignResult& result);

}  // namespace assembly_cell
