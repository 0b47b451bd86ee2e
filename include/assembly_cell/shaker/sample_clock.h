// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

namespace assembly_cell {

/// When each sample of a converter with a clock of its own will sound. The queue in front of it is
/// looked at now and then, with jitter; a loop of second order follows the converter's rate, so
/// that phases stay exact while its quartz is off by a hundredth of a per cent.
struct SampleClock {
  double nominal = 1.0 / 48000.0;  ///< [s] from one sample to the next, as it says
  double period = nominal;         ///< as it is
  double next = 0.0;               ///< when the next sample that is written will sound [s]
  bool known = false;
  std::uint64_t jumps = 0;  ///< the queue ran empty, or the computer's clock was put right
};

/// `samples` were written since the last look, and now one that is written would sound at
/// `measured` [s]. next is already that of the sample after them.
void observe(SampleClock& clock, double measured, double samples);

}  // namespace assembly_cell
