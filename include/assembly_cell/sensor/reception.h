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
  for (int i = 0; i < 3 && tightest > std::chrono::microseconds(2); ++i) {
    const auto before = std::chrono::steady_clock::now();
    const auto system = std::chrono::system_clock::now();
    const auto width = std::chrono::steady_clock::now() - before;
    if (width < tightest) best = {before + width / 2, system};
    tightest = std::min(tightest, width);
  }
  return best;
}

/// Both clocks at a point of the steady one; as if the system clock hadn't stepped since.
inline Reception receptionAt(std::chrono::steady_clock::time_point steady) {
  const Reception now = clocksNow();
  return {steady, now.system - std::chrono::duration_cast<std::chrono::system_clock::duration>(
                                   now.steady - steady)};
}

/// When something arrived, by the kernel's note on the system clock. A note from the future or from
/// before `earliest` was put off by a step of that clock: then it is now.
inline Reception arrivalOf(std::chrono::system_clock::time_point noted, const Reception& now,
                           std::chrono::steady_clock::time_point earliest) {
  const auto age = now.system - noted;
  if (age < std::chrono::nanoseconds(0) || age > now.steady - earliest) return now;
  return {now.steady - age, noted};
}

/// [s] as the clocks count them.
inline std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
}

}  // namespace assembly_cell
