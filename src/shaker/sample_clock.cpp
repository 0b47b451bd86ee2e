// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/sample_clock.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {

namespace {

constexpr double kJump = 5e-3;  // larger errors aren't jitter [s]
constexpr double kPull =
    0.02;  // of the error, each measurement; of the rate a quarter of its square
constexpr double kMaxError = 1e-3;  // of a converter's rate

}  // namespace

void observe(SampleClock& clock, double measured, double samples) {
  const double error = measured - clock.next;
  if (!clock.known || !(std::abs(error) < kJump)) {
    clock.jumps += clock.known ? 1 : 0;
    clock.next = measured;
    clock.known = true;
    return;
  }
  clock.next += kPull * error;
  if (samples <= 0.0) return;
  clock.period += 0.25 * kPull * kPull * error / samples;
  clock.period = std::clamp(clock.period, (1.0 - kMaxError) * clock.nominal,
                            (1.0 + kMaxError) * clock.nominal);
}

}  // namespace assembly_cell
