// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <cstdint>
#include <utility>

namespace assembly_cell {
namespace vibration {

inline double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

/// Where `holds` ends, to the last bit: it holds at `low` and not at `high`.
template <typename Predicate>
double lastOf(double low, double high, const Predicate& holds) {
  const auto sign = [&](double x) { return holds(x) ? 1.0 : -1.0; };
  const auto never = [](double, double) { return false; };
  std::uintmax_t limit = 200;  // halvings down to neighbours, from any two numbers of this room
  const std::pair<double, double> end = boost::math::tools::bisect(sign, low, high, never, limit);
  return 0.5 * (end.first + end.second);
}

}  // namespace vibration
}  // namespace assembly_cell
