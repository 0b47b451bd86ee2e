// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

#include "assembly_cell/guard/freshness.h"

namespace assembly_cell {

/// Stamp of a message: nanoseconds since 1970, or since a simulation's start; 0: none.
using StampNs = std::int64_t;
constexpr double kStampRounding = 1e-6;  ///< [s]
inline double seconds(StampNs stamp) {
  constexpr StampNs kSecond = 1000000000;
  return static_cast<double>(stamp / kSecond) + 1e-9 * static_cast<double>(stamp % kSecond);
}

/// Cell time of a node [s], relative to its first stamp. In lockstep it is that of the last block,
/// else it advances with the wall clock between two blocks, see CellClock.
class NodeTime {
 public:
  /// real_time_factor: cell time per wall-clock time of a simulation.
  NodeTime(bool lockstep, double real_time_factor);

  bool started() const { return epoch_ != 0; }
  void start(StampNs epoch) { epoch_ = epoch; }
  /// A block with this stamp has been received now.
  void observe(StampNs stamp);

  double now() const;
  double newest() const { return at(last_); }  ///< time of the newest block
  double at(StampNs stamp) const { return 1e-9 * static_cast<double>(stamp - epoch_); }
  StampNs stampAt(double time) const;

 private:
  double wall() const;  ///< monotonic, scaled to cell time [s]

  bool lockstep_;
  double real_time_factor_;
  CellClock clock_;
  StampNs epoch_ = 0, last_ = 0;
};

}  // namespace assembly_cell
