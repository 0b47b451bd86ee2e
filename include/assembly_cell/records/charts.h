// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Drift of a batch: control chart and capability of a number of each run.
#pragma once

#include <cstddef>
#include <vector>

namespace assembly_cell {

/// Exponentially weighted moving average: z_i = λ x_i + (1 − λ) z_{i−1}, z_0 = mean. Limits
/// mean ± L sd √(λ/(2 − λ) (1 − (1 − λ)^{2i})), the standard deviation of z_i for independent x_i
/// (Roberts 1959; Lucas and Saccucci 1990).
struct EwmaSettings {
  double lambda = 0.1;
  double L = 2.814;  ///< mean run length without drift 500 at λ = 0.1 (Lucas and Saccucci)
  /// Mean and standard deviation come from so many first values, which the chart begins after; 0:
  /// `mean` and `sd` are given.
  std::size_t baseline = 25;
  double mean = 0.0, sd = 0.0;
};

struct EwmaPoint {
  double z = 0.0, low = 0.0, high = 0.0;
  bool inside() const { return z >= low && z <= high; }
};

struct EwmaChart {
  double mean = 0.0, sd = 0.0;
  std::size_t baseline = 0;       ///< number of values before points[0]
  std::vector<EwmaPoint> points;  ///< of the values after the baseline
  std::size_t outside = 0;        ///< number of points outside of their limits
  std::size_t first_outside = 0;  ///< index of the value; that of no value: none
};
/// Throws InputError: λ not in (0, 1], L or sd not positive, fewer than baseline + 1 values, a
/// value that isn't finite, a baseline below 2 or without spread.
EwmaChart ewmaChart(const std::vector<double>& values, const EwmaSettings& settings);

/// An estimate with its two-sided confidence interval.
struct Interval {
  double estimate = 0.0, low = 0.0, high = 0.0;
};

/// Cp = (upper − lower) / 6 sd: exact interval of normal values, by χ² (Kane 1986).
/// Cpk = min(upper − mean, mean − lower) / 3 sd: interval Cpk ± z √(1/9n + Cpk²/(2n − 2)), an
/// approximation (Bissell 1990). One limit may be infinite: Cp is NaN then.
struct Capability {
  std::size_t n = 0;
  double mean = 0.0, sd = 0.0;
  Interval cp, cpk;
};
/// Throws InputError: fewer than 2 values, no spread, a value that isn't finite, limits that don't
/// rise, no finite limit, a level not in (0, 1).
Capability capability(const std::vector<double>& values, double lower, double upper,
                      double level = 0.95);

}  // namespace assembly_cell
