// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/roots.h"

#include <boost/math/tools/roots.hpp>
#include <cstdint>

namespace assembly_cell {
namespace {

constexpr std::uintmax_t kMaxEvaluations = 200;

}  // namespace

Bracket bisect(double low, double high, bool (*holds)(const void* predicate, double x),
               const void* predicate, double width, int halvings) {
  const auto sign = [&](double x) {
    if (x == low || x == high) return x == low ? 1.0 : -1.0;
    return holds(predicate, x) ? 1.0 : -1.0;
  };
  const auto narrow = [width](double a, double b) { return b - a <= width; };
  // three of them are the ends and the first middle
  std::uintmax_t evaluations = static_cast<std::uintmax_t>(halvings) + 3;
  const auto [first, last] = boost::math::tools::bisect(sign, low, high, narrow, evaluations);
  return {first, last};
}

Bracket rootIn(double low, double high, double (*value)(const void* function, double x),
               const void* function, double width) {
  const auto evaluate = [&](double x) { return value(function, x); };
  boost::math::tools::eps_tolerance<double> neighbours;
  const auto narrow = [&](double a, double b) { return b - a <= width || neighbours(a, b); };
  std::uintmax_t evaluations = kMaxEvaluations;
  const auto [first, last] =
      boost::math::tools::toms748_solve(evaluate, low, high, narrow, evaluations);
  return {first, last};
}

}  // namespace assembly_cell
