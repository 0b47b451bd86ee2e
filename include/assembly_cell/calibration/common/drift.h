// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Limits within which six signals count as settled.
struct SettlingLimits {
  std::size_t window = 50;  ///< latest samples that are evaluated, at least 8
  /// Sd of one sample of the sensor at rest, in the signals' units: the unit σ of all limits.
  /// Zero on an axis: taken from differences of neighbours, right for white noise only.
  Vector6 noise = Vector6::Zero();
  double spread = 5.0;        ///< largest deviation from the window's mean [σ]
  double trend = 3.0;         ///< change along the window's straight line, end to end [σ] ...
  double significance = 5.0;  ///< ... if the line's slope is this many of its own sd
};

enum class Settling {
  kFilling,  ///< fewer samples than the window
  kSpread,   ///< a sample is too far from the mean
  kTrend,    ///< the signals still run in one direction
  kSettled,
};
const char* toString(Settling verdict);  ///< filling, spread, trend, settled

/// Statistics of the window, in the signals' units unless another one is given.
struct SettlingReport {
  Settling verdict = Settling::kFilling;
  std::size_t samples = 0;
  int axis = 0;                         ///< axis with the largest value over its limit
  Vector6 mean = Vector6::Zero();       ///< over the window
  Vector6 variance = Vector6::Zero();   ///< of the mean, serial correlation included
  Vector6 sd = Vector6::Zero();         ///< of one sample about the straight line
  Vector6 deviation = Vector6::Zero();  ///< largest distance from the mean [σ]
  Vector6 change = Vector6::Zero();     ///< of the straight line over the window
  Vector6 change_sd = Vector6::Zero();  ///< of `change`, serial correlation included
};

/// Sliding window over evenly spaced samples: detects whether a sensor is at rest, or moves, creeps
/// or swings. add() costs O(1) on average (one pass over the buffer a lap) and allocates
/// nothing.
class SettledWindow {
 public:
  /// Throws InputError for a window below 8, noise that is negative or not finite, limits ≤ 0.
  explicit SettledWindow(const SettlingLimits& limits);

  /// Non-finite samples empty the window: it has to fill again.
  void add(const Vector6& sample);
  void clear();  ///< after a gap, a saturated sample or a commanded move

  SettlingReport report() const;

 private:
  /// Sums over a run of samples, relative to reference_; runs join in O(1).
  struct Run {
    double count = 0.0;
    Vector6 sum = Vector6::Zero(), squares = Vector6::Zero();
    Vector6 moment = Vector6::Zero();  ///< Σ (index in the run) x
    Vector6 steps = Vector6::Zero();   ///< Σ squared differences of neighbours
    Vector6 low = Vector6::Zero(), high = Vector6::Zero();
    Vector6 first = Vector6::Zero(), last = Vector6::Zero();
  };
  static Run runOf(const Vector6& x);
  static Run join(const Run& early, const Run& late);
  Run window() const;

  SettlingLimits limits_;
  std::vector<Vector6> samples_;  ///< of this lap; from position_ on of the previous one
  std::vector<Run> tails_;        ///< tails_[k]: samples k … end of the previous lap
  Run head_;                      ///< this lap
  Vector6 reference_ = Vector6::Zero();
  std::size_t position_ = 0;
  bool full_ = false;
};

}  // namespace assembly_cell
