// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Mean and standard deviation of six signals, one sample at a time (Welford).
class Moments {
 public:
  void add(const Vector6& x);
  std::size_t count() const { return count_; }
  const Vector6& mean() const { return mean_; }
  Vector6 sd() const;  ///< of one sample, n − 1; zero for fewer than two

 private:
  std::size_t count_ = 0;
  Vector6 mean_ = Vector6::Zero();
  Vector6 squares_ = Vector6::Zero();
};

/// White noise of six signals from differences of neighbours: slow loads and drift cancel.
class DifferenceNoise {
 public:
  void add(const Vector6& x);
  void breakRun() { has_last_ = false; }  ///< the next sample isn't a neighbour of the last
  void clear();                           ///< drops the differences, keeps the last sample
  std::size_t count() const { return count_; }
  Vector6 rms() const;  ///< of one sample: sqrt(mean(Δ²)/2); zero without differences

 private:
  std::size_t count_ = 0;
  Vector6 squares_ = Vector6::Zero();
  Vector6 last_ = Vector6::Zero();
  bool has_last_ = false;
};

/// What a block's sequence number means. Numbers count up by one, modulo 2³².
enum class Arrival { kNext, kLoss, kDuplicate, kRestart };

/// Watches sequence numbers. A number at most 100 behind is a duplicate; farther behind, or back at
/// 0 or 1, the source has restarted.
class SequenceMonitor {
 public:
  Arrival accept(std::uint32_t sequence);
  std::uint64_t lost() const { return lost_; }              ///< blocks
  std::uint64_t duplicates() const { return duplicates_; }  ///< repeated or out of order
  std::uint64_t restarts() const { return restarts_; }

 private:
  bool started_ = false;
  std::uint32_t last_ = 0;
  std::uint64_t lost_ = 0, duplicates_ = 0, restarts_ = 0;
};

}  // namespace assembly_cell
