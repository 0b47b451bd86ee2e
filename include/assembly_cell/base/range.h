// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <limits>
#include <string>

namespace assembly_cell {

/// Closed interval of a finite number and the number's unit.
struct Range {
  static constexpr double kMax = std::numeric_limits<double>::max();
  /// Smaller numbers lose digits, and their reciprocal may be infinite.
  static constexpr double kMinPositive = std::numeric_limits<double>::min();

  double low = -kMax;
  double high = kMax;
  const char* unit = "";  ///< a literal; empty: none

  /// False for NaN and infinity.
  constexpr bool contains(double value) const { return value >= low && value <= high; }

  static const Range kAny, kNotNegative, kPositive;
};

inline constexpr Range Range::kAny{};
inline constexpr Range Range::kNotNegative{0.0, Range::kMax};
inline constexpr Range Range::kPositive{Range::kMinPositive, Range::kMax};

constexpr Range finite(const char* unit) { return {-Range::kMax, Range::kMax, unit}; }
constexpr Range notNegative(const char* unit, double high = Range::kMax) {
  return {0.0, high, unit};
}
constexpr Range positive(const char* unit, double high = Range::kMax) {
  return {Range::kMinPositive, high, unit};
}

/// What to give: "give a number from 0 to 60 [s]", "give a finite number > 0".
std::string remedy(const Range& range);

/// Empty, or "VALUE: give a number from ...": not finite, or out of range.
std::string outside(double value, const Range& range);

}  // namespace assembly_cell
