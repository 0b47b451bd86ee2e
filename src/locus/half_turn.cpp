// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/half_turn.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {

using Eigen::Vector2d;
using Eigen::Vector3d;
using linear_motion::Complex;
using linear_motion::Complex9;

namespace {

// Relative error of the predicted vertical motion and yaw. At half and twice of it all 1620
// directions of docs/theory/locus.md, "Constants", are resolved the same way.
constexpr double kModelError = 0.05;
constexpr int kVertical = linear_motion::kU + 2, kYaw = linear_motion::kTheta + 2;

// odds of the first direction against the other, as a logarithm that stays finite
double logOdds(double weight) {
  constexpr double kSmallest = 1e-300;
  return std::log(std::max(weight, kSmallest)) - std::log(std::max(1.0 - weight, kSmallest));
}

DirectionEstimate withOdds(DirectionEstimate estimate, double odds) {
  if (odds < 0.0) {
    std::swap(estimate.alpha, estimate.alpha_opposite);
    odds = -odds;
  }
  estimate.weight = 1.0 / (1.0 + std::exp(-odds));
  return estimate;
}

}  // namespace

HalfTurnEvidence halfTurnEvidence(const Mechanism& mechanism, double frequency,
                                  const HarmonicFit& fit) {
  const linear_motion::UnheldMotion free(mechanism, frequency, Vector2d::Zero(), Vector2d::Zero());
  const Eigen::Matrix<Complex, 9, 6> motion =
      linear_motion::motionFromSensor(mechanism, free, Vector3d::Zero()) *
      linear_motion::sensorStiffness(mechanism).cast<Complex>();
  const auto measured = [&](int row) {
    const Eigen::Matrix<Complex, 1, 6> m = motion.row(row);
    const double noise = (m * fit.noise.cast<Complex>() * m.adjoint()).value().real();
    // a phasor has twice the variance of P and N
    return MeasuredPhasor{m * fit.phasor,
                          2.0 * noise * fit.inflation / static_cast<double>(fit.samples)};
  };
  return {measured(kVertical), measured(kYaw)};
}

DirectionEstimate resolveHalfTurn(const Mechanism& mechanism, const OperatingPoint& point,
                                  const HalfTurnEvidence& evidence, DirectionEstimate estimate,
                                  LocusAxes axes) {
  return linear_motion::resolveHalfTurn(linear_motion::SeenMotion(mechanism, point, axes), evidence,
                                        estimate);
}

DirectionEstimate linear_motion::resolveHalfTurn(const SeenMotion& seen,
                                                 const HalfTurnEvidence& evidence,
                                                 const DirectionEstimate& estimate) {
  const Complex9 first = seen(estimate.alpha), second = seen(estimate.alpha_opposite);
  const double error = std::max(kModelError, estimate.misfit);
  double odds = logOdds(estimate.weight);
  const auto weigh = [&](const std::optional<MeasuredPhasor>& measured, int row) {
    if (!measured) return;
    const double size = 0.5 * (std::norm(first[row]) + std::norm(second[row]));
    const double variance = measured->variance + error * error * size;
    const double gain =
        (std::norm(measured->value - second[row]) - std::norm(measured->value - first[row])) /
        (2.0 * variance);
    if (std::isfinite(gain)) odds += gain;
  };
  weigh(evidence.vertical, kVertical);
  weigh(evidence.yaw, kYaw);
  return withOdds(estimate, odds);
}

}  // namespace assembly_cell
