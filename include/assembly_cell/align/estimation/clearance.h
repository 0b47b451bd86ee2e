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

/// The clearance by the drawing. Radii are uniform within their tolerances; without any it is the
/// drawn one, give or take a half of it, or 20 µm where that is more.
inline Clearance drawnClearance(const Mechanism& mechanism) {
  constexpr double kForm = 1e-6;  // of parts that are never perfectly round [m]
  const HoleParameters& hole = mechanism.hole;
  const PegParameters& peg = mechanism.peg;
  double drawn = hole.radius - peg.radius, variance = 0.0;
  const auto add = [&](double radius, const RadiusTolerance& tolerance, double sign) {
    if (tolerance == kNoTolerance) return;
    const double width = tolerance[1] - tolerance[0];
    drawn += sign * (0.5 * (tolerance[0] + tolerance[1]) - radius);
    variance += width * width / 12.0;
  };
  add(hole.radius, hole.radius_tolerance, 1.0);
  add(peg.radius, peg.radius_tolerance, -1.0);
  if (hole.radius_tolerance == kNoTolerance && peg.radius_tolerance == kNoTolerance) {
    return {drawn, std::max(0.5 * drawn, 2e-5)};
  }
  return {drawn, std::max(std::sqrt(variance), kForm)};
}

}  // namespace assembly_cell
