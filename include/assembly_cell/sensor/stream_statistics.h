// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "assembly_cell/sensor/sensor_samples.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell {

/// What a stream of blocks was like since the report before.
struct StreamReport {
  std::uint64_t lost = 0, duplicates = 0, restarts = 0;  ///< blocks; times the numbers restarted
  std::uint8_t saturated = 0;                            ///< a bit for each channel
  unsigned outside = 0;    ///< a bit for each channel: means beyond the calibration's tests
  bool malformed = false;  ///< some blocks were
  std::string fault;       ///< of the last malformed block, one line
  double rate = 0.0;       ///< as measured last [Hz]
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< of the last block [°C]
  Vector6 noise_rms = Vector6::Zero();  ///< of a wrench sample [N], [N·m]
  std::size_t noise_samples = 0;        ///< differences that noise_rms is of
  // since the start
  std::uint64_t total_samples = 0, total_saturated = 0, total_malformed = 0;
  std::uint64_t total_lost = 0, total_duplicates = 0, total_restarts = 0;
};

/// Counts, rate and noise of a stream of blocks, for diagnostics.
class StreamStatistics {
 public:
  struct Begin {
    Arrival arrival;
    bool restarted;  ///< the time base: the first block, a restart, or stamps that went back
  };
  /// Before a block's samples.
  Begin begin(const BridgeBlock& block);
  void addSample(const Vector6& wrench, std::uint8_t saturated);
  void addMalformed(std::uint32_t sequence, const std::string& fault);
  void addOutside(unsigned channels) { report_.outside |= channels; }

  void breakNoise() { noise_.breakRun(); }  ///< the next sample doesn't follow on the last one
  /// Starts a new estimate; until it is complete the previous one is reported.
  void restartNoise() { noise_ = DifferenceNoise(); }
  void clearNoise();  ///< samples so far are of another calibration: its estimate counts no more

  /// Starts the next interval.
  StreamReport report();

 private:
  void measure();

  SequenceMonitor sequence_;
  DifferenceNoise noise_;
  StreamReport report_;  // since the report before
  bool rate_started_ = false;
  double last_time_ = 0.0;          // of the newest sample [s]
  double rate_from_ = 0.0;          // time of the sample that the rate is counted from [s]
  std::uint64_t rate_samples_ = 0;  // since then
};

}  // namespace assembly_cell
