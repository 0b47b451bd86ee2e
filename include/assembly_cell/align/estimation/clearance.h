// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <cmath>

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Radius of the hole less that of the peg, as an estimate.
struct Clearance {
  double mean = 0.0;  ///< [m]
  double sd = 0.0;    ///< [m]

  /// Upper bound, at three standard deviations. [m]
  double high() const { return mean + 3.0 * sd; }
  /// What steps follow: the mean, or the sd of a wall's position where that is more. [m]
  double step() const { return std::max(mean, 4e-6); }
  /// Combines it with an independent measurement, both in metres.
  void add(double measured, double measured_sd) {
    const double sum = sd * sd + measured_sd * measured_sd;
    mean += sd * sd / sum * (measured - mean);
    sd *= measured_sd / std::sqrt(sum);
  }
};

/// The clearance of a drawing without tolerances: give or take a half of it, or 20 µm where that is
/// more.
inline Clearance drawnClearance(const Mechanism& mechanism) {
  const double drawn = mechanism.hole.radius - mechanism.peg.radius;
  return {drawn, std::max(0.5 * drawn, 2e-5)};
}

}  // namespace assembly_cell
