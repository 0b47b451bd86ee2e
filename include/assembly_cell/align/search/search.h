// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>

#include "assembly_cell/align/search/bore_entry.h"
#include "assembly_cell/align/search/light_touch.h"

namespace assembly_cell {

/// The parts of a search, which strategies put together, and its frame: the path from the start to
/// the result.
struct Search {
  Search(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
         const ProgressCallback& progress);

  /// Hanging free at rest: S from here on. True when the peg is in the hole already: walls on all
  /// four sides; its centre is known then, its axis isn't.
  bool begin();

  /// Runs `find`, which calls begin() and puts the peg's edge into the hole, then the insertion; a
  /// peg that failed is freed. `summarise` adds what is known of the hole to the result; it is only
  /// called where one was found. An AlignError becomes the result's failure; throws PlantError.
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

/// The estimate of the hole as the result of a strategy.
void summariseHole(const SearchState& state, AlignResult& result);

}  // namespace assembly_cell
