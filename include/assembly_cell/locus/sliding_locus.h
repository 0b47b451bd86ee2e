// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <vector>

#include "assembly_cell/locus/harmonic_fit.h"

namespace assembly_cell {

/// Locus over a sliding window, new with every sample, at a cost that does not depend on the
/// window: least squares on cos a, sin a and an offset, exact for any window, from sums to which
/// the newest sample is added and from which the oldest is taken. The sums are replaced by freshly
/// accumulated ones once a window, so rounding does not pile up. Settles within one window after a
/// step; group delay half a window. No allocation after construction.
class SlidingLocus {
 public:
  /// window: samples, best whole periods of the exciter. Throws InputError for fewer than 8.
  explicit SlidingLocus(std::size_t window);

  /// Exciter's angle [rad] and position [m] of a sample. One that is not finite empties the window
  /// and returns false: a window has no holes.
  bool add(double angle, double x, double y);

  void reset();
  std::size_t window() const { return ring_.size(); }
  std::size_t samples() const { return count_; }  ///< in the window
  bool full() const { return count_ == ring_.size(); }

  /// Of the samples in the window; noise is what the fit leaves. Throws InputError with fewer than
  /// 8 samples, or where they do not resolve the exciter's angle (less than a good part of a turn,
  /// or always the same angles).
  Locus locus() const;

 private:
  // of one sample, and their sums; x and y relative to origin_
  struct Sums {
    double c = 0, s = 0, cc = 0, cs = 0, x = 0, xc = 0, xs = 0, y = 0, yc = 0, ys = 0, zz = 0;
    void add(const Sums& o, double sign);
  };
  struct Sample {
    double c, s, x, y;
    Sums terms() const {
      return {c, s, c * c, c * s, x, x * c, x * s, y, y * c, y * s, x * x + y * y};
    }
  };

  std::vector<Sample> ring_;
  std::size_t next_ = 0, count_ = 0, fresh_count_ = 0;
  Sums sums_, fresh_;
  double origin_x_ = 0.0, origin_y_ = 0.0;
};

}  // namespace assembly_cell
