// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/median.h"

#include <algorithm>
#include <cstddef>

namespace assembly_cell {

double upperMedian(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double upperMedian(std::vector<double>&& values) { return upperMedian(values); }

double medianSpacing(const std::vector<double>& times) {
  std::vector<double> spacing;
  spacing.reserve(times.size());
  for (std::size_t i = 1; i < times.size(); ++i) spacing.push_back(times[i] - times[i - 1]);
  return upperMedian(spacing);
}

}  // namespace assembly_cell
