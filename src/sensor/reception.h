// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// Both clocks at one moment: the closest of three pairs of readings.
inline Reception clocksNow() {
  Reception best;
  auto tightest = std::chrono::steady_clock::duration::max();
  for (int i = 0; i < 3; ++i) {
    const auto before = std::chrono::steady_clock::now();
    const auto system = std::chrono::system_clock::now();
    const auto width = std::chrono::steady_clock::now() - before;
    if (width < tightest) best = {before + width / 2, system};
    tightest = std::min(tightest, width);
    if (tightest < std::chrono::microseconds(2)) break;
  }
  return best;
}

/// Both clocks at a point of the steady one.
inline Reception receptionAt(std::chrono::steady_clock::time_point steady) {
  const Reception now = clocksNow();
  return {steady, now.system - std::chrono::duration_cast<std::chrono::system_clock::duration>(
                                   now.steady - steady)};
}

/// [s] as the clocks count them.
inline std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
}

}  // namespace assembly_cell
