// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cmath>

namespace assembly_cell {

/// Integral over [a, b] in long double: Gauss–Legendre of 12 nodes in panels.
template <typename Function>
long double integrate(const Function& f, long double a, long double b, int panels) {
  constexpr int kNodes = 12;
  static const auto kRule = [] {
    std::array<std::array<long double, 2>, kNodes> rule{};
    for (int i = 0; i < kNodes; ++i) {
      long double x = std::cos(3.14159265358979323846L * (i + 0.75L) / (kNodes + 0.5L)), slope = 0;
      for (int step = 0; step < 20; ++step) {
        long double p = 1, q = 0;
        for (int n = 1; n <= kNodes; ++n) {
          const long double next = ((2 * n - 1) * x * p - (n - 1) * q) / n;
          q = p;
          p = next;
        }
        slope = kNodes * (x * p - q) / (x * x - 1);
        x -= p / slope;
      }
      rule[static_cast<std::size_t>(i)] = {x, 2 / ((1 - x * x) * slope * slope)};
    }
    return rule;
  }();
  const long double half = (b - a) / panels / 2;
  long double sum = 0;
  for (int panel = 0; panel < panels; ++panel) {
    for (const auto& node : kRule) sum += node[1] * f(a + half * (2 * panel + 1 + node[0]));
  }
  return sum * half;
}

}  // namespace assembly_cell
