// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

namespace assembly_cell {

/// Output time of each sample of a converter with a clock of its own. The length of its queue is
/// measured now and then, with jitter; a second-order loop estimates the converter's rate, so that
/// phases stay exact with a quartz error of 1e-4.
struct SampleClock {
  double nominal = 1.0 / 48000.0;  ///< nominal sample period [s]
  double period = nominal;         ///< estimated [s]
  double next = 0.0;               ///< output time of the next written sample [s]
  bool known = false;
  std::uint64_t jumps = 0;  ///< the queue ran empty, or the computer's clock was set
};

/// A sample written now would be output at `measured` [s]; `samples` were written since the last
/// measurement, and are included in `next`.
void observe(SampleClock& clock, double measured, double samples);

}  // namespace assembly_cell
