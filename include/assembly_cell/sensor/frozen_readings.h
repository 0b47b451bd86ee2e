// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <string>

namespace assembly_cell {

/// What to do about them: after describe().
constexpr const char* kFrozenRemedy =
    ": the device or its link is frozen: look at its power and wires, or set frozen_after: 0 if "
    "its noise is below a step of its converter";

/// Finds readings that stand still: successive samples whose six numbers are the same to the last
/// bit. The last bits of a converter move with its noise, so that they mean a broken device or
/// link, unless the noise is below a step of the converter (10 bit, a simulation without noise).
class FrozenReadings {
 public:
  /// Equal samples that are reported, and the least that count as frozen. A device that sends each
  /// measurement up to 14 times (500 Hz at 7 kHz) stays below; half of it leaves no margin for a
  /// filter of 300 Hz, twice of it is a second of the slowest device (100 Hz).
  static constexpr std::size_t kReported = 50;

  /// Duration of equal samples from which on they count as frozen [s]; 0: never, nothing is
  /// reported.
  void setLimit(double seconds) { limit_ = seconds; }

  /// The next sample; period: to the one before [s].
  void add(const double* sample, double period);

  std::size_t run() const { return run_; }  ///< equal samples up to the latest
  bool isFrozen() const { return limit_ > 0.0 && run_ >= kReported && time_ >= limit_; }
  /// Are the latest `samples` all equal (and is there a limit)?
  bool covers(std::size_t samples) const { return limit_ > 0.0 && run_ >= samples; }
  /// Longest run since the call before, as a text; empty: below kReported, or no limit.
  std::string report();
  /// "all six channels have had exactly the same reading for 1.2 s (1200 samples)"
  std::string describe() const;

 private:
  std::array<double, 6> last_{};
  std::size_t run_ = 0, longest_ = 0;
  double time_ = 0.0;  // of the run [s]
  double limit_ = 0.0;
};

}  // namespace assembly_cell
