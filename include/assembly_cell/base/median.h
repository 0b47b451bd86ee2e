// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

namespace assembly_cell {

/// The value with index size / 2 of the sorted values: of an even number the upper one of the two
/// in the middle. Reorders the values; they must not be empty nor contain NaN.
double upperMedian(std::vector<double>& values);
double upperMedian(std::vector<double>&& values);

/// Median of the differences between neighbours of at least two times in order [unit of times].
double medianSpacing(const std::vector<double>& times);

}  // namespace assembly_cell
