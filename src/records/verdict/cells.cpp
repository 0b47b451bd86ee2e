// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "verdict/cells.h"

#include <algorithm>
#include <limits>

namespace assembly_cell {

bool isFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

PathEnds pathEnds(const std::vector<double>& path) {
  return {path.front(), *std::max_element(path.begin(), path.end())};
}

CellValues::CellValues(std::size_t cells)
    : low(cells, std::numeric_limits<double>::quiet_NaN()), high(low), low_at(low), high_at(low) {}

void CellValues::add(std::size_t cell, double place, double value) {
  if (!(low[cell] <= value)) {
    low[cell] = value;
    low_at[cell] = place;
  }
  if (!(high[cell] >= value)) {
    high[cell] = value;
    high_at[cell] = place;
  }
}

CellValues cellValues(const Band& band, const Curve& curve, const std::string& quantity) {
  const std::vector<double>& path = pathOf(curve, band.over_time);
  const std::vector<double>& values = curveValues(curve, quantity);
  const auto count = static_cast<std::ptrdiff_t>(band.cells());
  CellValues cells(band.cells());
  // -1: before the band; count: behind its last cell, which a band over depth extends
  const auto cellOf = [&](double place) {
    const double cell = std::floor((place - band.from) / band.step);
    return static_cast<std::ptrdiff_t>(std::clamp(cell, -1.0, static_cast<double>(count)));
  };
  const auto add = [&](std::ptrdiff_t cell, double place, double value) {
    if (cell == count && !band.over_time) --cell;
    if (cell >= 0 && cell < count) cells.add(static_cast<std::size_t>(cell), place, value);
  };
  double farthest = path.front();
  std::ptrdiff_t now = cellOf(farthest);
  add(now, path[0], values[0]);
  for (std::size_t i = 1; i < path.size(); ++i) {
    if (path[i] > farthest) {
      farthest = path[i];
      const std::ptrdiff_t next = cellOf(farthest);
      for (std::ptrdiff_t bound = now + 1; bound <= next; ++bound) {
        const double place = band.from + band.step * static_cast<double>(bound);
        const double part = std::clamp((place - path[i - 1]) / (path[i] - path[i - 1]), 0.0, 1.0);
        const double value = values[i - 1] + part * (values[i] - values[i - 1]);
        add(bound - 1, place, value);
        add(bound, place, value);
      }
      now = next;
    }
    add(now, path[i], values[i]);
  }
  return cells;
}

}  // namespace assembly_cell
