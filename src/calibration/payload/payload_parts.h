// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Parts of identifyPayload(): linear functions of a fitted bias, correction of the sensor.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>

#include "assembly_cell/calibration/payload/payload.h"
#include "bias_search.h"

namespace assembly_cell {

struct Functional {
  Eigen::VectorXd row;     ///< on the effects
  Eigen::VectorXd kernel;  ///< drift covariance with the fitted readings, unit rate
  double variance = 0.0;
};

struct Estimate {
  double value = 0.0, variance = 0.0;
};

/// The bias of an axis at a time.
Functional biasFunctional(const PayloadModel& model, std::size_t axis, double order,
                          double temperature);
Estimate evaluate(const PayloadModel& model, std::size_t axis, const Functional& f);

/// From the bias at used pose `from` to that at `to`, at the mean temperature.
Estimate biasChange(const PayloadModel& model, std::size_t axis, std::size_t from, std::size_t to);

/// First used pose after the break whose largest jump is smallest, if that is no more than `limit`
/// standard deviations of a reading.
std::optional<std::size_t> smallestBreak(const PayloadModel& model, double limit);

/// f = A Rᵀg + b, τ = (c× + S) f + b with S symmetric.
InSituCorrection correctInSitu(const PayloadModel& model, const bias_series::Problem& problem,
                               const PayloadOptions& options);

}  // namespace assembly_cell
