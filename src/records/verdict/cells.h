// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A curve over the cells of a band.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "assembly_cell/records/band.h"

namespace assembly_cell {

/// Times or depths of the samples.
inline const std::vector<double>& pathOf(const Curve& curve, bool over_time) {
  return over_time ? curve.time : curve.depth;
}

bool isFinite(const std::vector<double>& values);

/// First and largest place of a path that isn't empty; finite values.
struct PathEnds {
  double begin = 0.0, end = 0.0;
};
PathEnds pathEnds(const std::vector<double>& path);

/// Smallest and largest value of each cell and where they are; NaN: the curve has none there.
struct CellValues {
  explicit CellValues(std::size_t cells);
  std::vector<double> low, high, low_at, high_at;
  bool has(std::size_t cell) const { return !std::isnan(low[cell]); }
  void add(std::size_t cell, double place, double value);
};

/// A sample counts in the cell of the farthest place so far, so that those of a peg that is pulled
/// up and lowered again, or that is stuck, count where it has come to. Values at the cells' bounds
/// are interpolated and count on both sides. Finite values.
CellValues cellValues(const Band& band, const Curve& curve, const std::string& quantity);

}  // namespace assembly_cell
