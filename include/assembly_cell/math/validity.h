// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <initializer_list>
#include <utility>

namespace assembly_cell {

// Checks of the closed forms: input outside their validity, and results that overflow, throw
// InputError with one line naming parameter, value and remedy.

[[noreturn]] void refuse(const char* name, double value, const char* remedy);

inline void requireFinite(const char* name, double value) {
  if (!std::isfinite(value)) refuse(name, value, "give a finite number");
}
inline void requirePositive(const char* name, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) refuse(name, value, "give a positive number");
}
inline void requireNotNegative(const char* name, double value) {
  if (!(value >= 0.0) || !std::isfinite(value)) refuse(name, value, "give a number, at least 0");
}

/// Throws unless all of several values are finite, each with its name.
using Named = std::initializer_list<std::pair<const char*, double>>;
inline void requireFinite(Named values) {
  for (const auto& v : values) requireFinite(v.first, v.second);
}
inline void requirePositive(Named values) {
  for (const auto& v : values) requirePositive(v.first, v.second);
}
inline void requireNotNegative(Named values) {
  for (const auto& v : values) requireNotNegative(v.first, v.second);
}

/// A result, or a refusal when the input was so large or small that it overflowed.
inline double finiteResult(const char* name, double value) {
  if (!std::isfinite(value)) {
    refuse(name, value, "result out of range, give parameters of comparable size");
  }
  return value;
}

}  // namespace assembly_cell
