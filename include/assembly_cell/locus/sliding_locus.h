// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <vector>

#include "assembly_cell/locus/harmonic_fit.h"

namespace assembly_cell {

/// The fit of fitHarmonic over a sliding window, new with every sample, at a cost that does not
/// depend on the window: least squares on cos a, sin a, an offset and, on request, a drift, exact
/// for any window, from sums to which the newest sample is added and from which the oldest is
/// taken. The sums are replaced by freshly accumulated ones once a window, so rounding does not
/// pile up. Settles within one window after a step; group delay half a window. No allocation after
/// construction. kSignals: 2 (the plane) or 6 (a displacement).
template <int kSignals>
class SlidingFit {
 public:
  using Values = Eigen::Matrix<double, kSignals, 1>;
  using Squares = Eigen::Matrix<double, kSignals, kSignals>;

  /// window: samples, best whole periods of the exciter. Throws InputError for fewer than 8.
  explicit SlidingFit(std::size_t window, bool drift = false);

  /// Exciter's angle [rad] and signals of a sample. One that is not finite empties the window and
  /// returns false: a window has no holes.
  bool add(double angle, const Values& signals);

  void reset();
  std::size_t window() const { return ring_.size(); }
  std::size_t samples() const { return count_; }  ///< in the window
  bool full() const { return count_ == ring_.size(); }

  /// Fit to the samples in the window; noise is what the fit leaves, offsets are those at the
  /// window's centre, signals beyond kSignals are zero. Throws InputError with fewer than 8
  /// samples, or where they do not resolve the exciter's angle (less than a good part of a turn, or
  /// always the same angles).
  HarmonicFit fit() const;

 private:
  // sums over samples; d: place in the window, signals relative to origin_
  struct Sums {
    double c = 0, s = 0, cc = 0, cs = 0, d = 0, dd = 0, dc = 0, ds = 0;
    Values x = Values::Zero(), xc = Values::Zero(), xs = Values::Zero(), xd = Values::Zero();
    Squares xx = Squares::Zero();
  };
  struct Sample {
    double c = 0, s = 0;
    Values x = Values::Zero();
  };
  void put(const Sample& sample, double place);
  void take(const Sample& sample, double place);

  std::vector<Sample> ring_;
  bool drift_;
  std::size_t next_ = 0, count_ = 0, fresh_count_ = 0;
  Sums sums_, fresh_;
  Values origin_ = Values::Zero();
};

extern template class SlidingFit<2>;
extern template class SlidingFit<6>;

/// The locus in the plane over a sliding window.
class SlidingLocus {
 public:
  explicit SlidingLocus(std::size_t window) : fit_(window) {}

  /// Exciter's angle [rad] and position [m] of a sample; as SlidingFit::add.
  bool add(double angle, double x, double y) { return fit_.add(angle, {x, y}); }

  void reset() { fit_.reset(); }
  std::size_t window() const { return fit_.window(); }
  std::size_t samples() const { return fit_.samples(); }
  bool full() const { return fit_.full(); }

  /// As SlidingFit::fit.
  Locus locus() const;

 private:
  SlidingFit<2> fit_;
};

}  // namespace assembly_cell
