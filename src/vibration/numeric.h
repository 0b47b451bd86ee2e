// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>

#include "assembly_cell/math/roots.h"

namespace assembly_cell {
namespace vibration {

inline double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

/// Bisection to the last bit for the boundary of `holds`, true at `low` and false at `high`.
template <typename Predicate>
double lastOf(double low, double high, const Predicate& holds) {
  const Bracket end = bisect(low, high, holds);
  return 0.5 * (end.low + end.high);
}

}  // namespace vibration
}  // namespace assembly_cell
