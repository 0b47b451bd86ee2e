// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

/// Sums over the samples of a block from values at every `spacing`-th of them and at the block's
/// start: exact for cubics but for their slope's change over the block, times the samples' period
/// over 12. The trapezoidal rule less half of the first value and with half of the last one more,
/// over pairs of intervals as in Simpson's rule.
class SampleSum {
 public:
  /// samples: of a block; most: upper bound of the spacing, 1 or more.
  SampleSum(int samples, int most);

  int spacing() const { return spacing_; }
  int nodes() const { return samples_ / spacing_; }
  /// Weight of the value at sample node·spacing, counted from 1; node 0 is the block's start. All
  /// sum to the number of samples; none is below 0.
  double weight(int node) const;

 private:
  int samples_, spacing_;
  double end_, middle_;
};

/// Mean and covariance of a block of samples of one bridge, as momentsOf() has them of the samples
/// themselves, from the strain at some of them. What noise and rounding do to both is drawn from
/// their distributions: normal and Wishart. The product of strain and noise is left out of the
/// covariance.
class BlockMeans {
 public:
  /// Noise hides the converter's codes, and there are enough samples for a covariance.
  static bool serves(const Bridge& bridge, int samples);

  /// Strain volts as of deflect(), bridge at its temperature then.
  void add(const Bridge& bridge, const Vector6& volts, double weight);
  BlockMoments end(const Bridge& bridge, int samples, NormalSource& normal) const;
  /// A channel was at its limit.
  bool saturated() const { return saturated_; }

 private:
  bool saturated_ = false, begun_ = false;
  Vector6 first_ = Vector6::Zero(), sum_ = Vector6::Zero();
  Matrix6 squares_ = Matrix6::Zero();  // about the first
};

}  // namespace assembly_cell
