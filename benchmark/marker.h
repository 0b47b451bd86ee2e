// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

namespace assembly_cell {

/// Time of a fixed piece of arithmetic, the fastest of many [ns]: 400 multiplications and additions
/// in four dependent chains and 8 sines with cosines.
/// Printed beside other times so that a slower machine shows. Frozen: never change it.
inline double markerTime() {
  constexpr int kLoops = 20000, kRepeats = 15;
  double best = 1e300;
  volatile double sink = 0.0;
  for (int r = 0; r < kRepeats; ++r) {
    double a = 0.1 + 0.01 * r, b = 0.2, c = 0.3, d = 0.4;
    const auto start = std::chrono::steady_clock::now();
    for (int loop = 0; loop < kLoops; ++loop) {
      for (int i = 0; i < 50; ++i) {
        a = a * 0.999 + 0.001;
        b = b * 0.998 + 0.002;
        c = c * 0.997 + 0.003;
        d = d * 0.996 + 0.004;
      }
      for (int i = 0; i < 8; ++i) {
        a += 1e-3 * std::sin(b + i);
        b += 1e-3 * std::cos(b + i);
      }
    }
    const std::chrono::duration<double, std::nano> time = std::chrono::steady_clock::now() - start;
    sink = sink + a + b + c + d;
    best = std::min(best, time.count() / kLoops);
  }
  return best;
}

}  // namespace assembly_cell
