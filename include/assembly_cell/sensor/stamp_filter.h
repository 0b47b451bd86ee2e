// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// When samples were taken, from when they arrived. A delay is never negative, so the line
/// time(sequence) lies below all arrivals: of those lines, the one nearest to the latest 256
/// blocks' arrivals (an edge of their lower convex hull; Moon, Skelly, Towsley 1999, Zhang, Liu,
/// Xia 2002). Its slope is the device's own period. Works on the steady clock, so that a step of
/// the system clock moves the stamps by just that step. The minimal delay of the link stays in the
/// stamps.
class StampFilter {
 public:
  /// What the filter makes of a block.
  struct Stamp {
    Reception time;          ///< of the block's first sample; its last one is never after received
    double period = 0.0;     ///< measured [s]; the block's own until enough has arrived
    double delay = 0.0;      ///< of the block's last sample beyond the minimal one [s]
    bool restarted = false;  ///< the filter restarted: first block, new stream, or 0.25 s too late
  };

  /// No allocation.
  Stamp update(const SourceBlock& block);
  void reset() { size_ = 0; }

 private:
  static constexpr std::size_t kWindow = 256;  // blocks

  struct Arrival {
    double sample;  // number from base_sequence_ on
    double time;    // since base_time_ [s]
  };
  struct Line {
    double time, period;  // at sample 0 [s], slope [s]
  };
  Line fit(double nominal) const;
  void rebase();

  std::array<Arrival, kWindow> arrivals_;  // a ring
  std::size_t size_ = 0, next_ = 0;
  std::uint32_t stream_ = 0;
  std::uint64_t base_sequence_ = 0;
  std::chrono::steady_clock::time_point base_time_;
  double last_ = 0.0;  // time given to the latest block's last sample, since base_time_ [s]
};

}  // namespace assembly_cell
