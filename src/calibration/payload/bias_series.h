// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// One bias component as a time series: what its drift does to columns of a linear model.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "assembly_cell/calibration/payload/payload.h"

namespace assembly_cell::bias_series {

/// Quantile of chi-square by Wilson and Hilferty (relative error < 1 % for p ≥ 1e-6), not that of
/// math/distributions.h: the exact value would change the limits in their third digit and so the
/// detected breaks and outliers.
double chiSquareQuantile(int dof, double upper_tail);
/// P(N(0,1) beyond ±z).
double twoSided(double z);
/// Survival of chi-square by the same approximation.
double chiSquareTail(int dof, double x);

/// Premultiplies the columns by L⁻¹, L Lᵀ = I + ratio K, K the drift's covariance at unit rate,
/// zero at each recording's first pose; returns log det(I + ratio K). O(n) a column (Kalman).
double whiten(DriftShape shape, double ratio, const std::vector<double>& order,
              const std::vector<std::size_t>& starts, Eigen::MatrixXd& columns);

/// K(s, t) within one recording that began at `origin`; s, t before it count as uncorrelated.
double covariance(DriftShape shape, double s, double t, double origin);

/// Level of each recording, slope where the shape has one.
bool hasSlope(DriftShape shape);
void fillOwnEffects(DriftShape shape, const std::vector<double>& order,
                    const std::vector<std::size_t>& starts, double at, std::size_t recording,
                    Eigen::Ref<Eigen::VectorXd> row);

}  // namespace assembly_cell::bias_series
