// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "bias_series.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/math/distributions.h"
#include "assembly_cell/math/roots.h"

namespace assembly_cell::bias_series {

namespace {

// z with upper tail p
double normalQuantile(double p) {
  const Bracket z = bisect(
      -40.0, 40.0, [p](double x) { return normalTail(x) > p; }, 0.0, 80);
  return 0.5 * (z.low + z.high);
}

double recordingEnd(const std::vector<double>& order, const std::vector<std::size_t>& starts,
                    std::size_t recording) {
  return recording + 1 < starts.size() ? order[starts[recording + 1] - 1] : order.back();
}

}  // namespace

double chiSquareQuantile(int dof, double upper_tail) {
  const double v = 2.0 / (9.0 * dof);
  return dof * std::pow(1.0 - v + normalQuantile(upper_tail) * std::sqrt(v), 3);
}

double twoSided(double z) { return 2.0 * normalTail(std::abs(z)); }

double chiSquareTail(int dof, double x) {
  const double v = 2.0 / (9.0 * dof);
  const double z = (std::cbrt(std::max(x, 0.0) / dof) - 1.0 + v) / std::sqrt(v);
  return normalTail(z);
}

double whiten(DriftShape shape, double ratio, const std::vector<double>& order,
              const std::vector<std::size_t>& starts, Eigen::MatrixXd& columns) {
  if (ratio <= 0.0 || (shape != DriftShape::kRandomWalk && shape != DriftShape::kSmooth)) {
    return 0.0;
  }
  const bool smooth = shape == DriftShape::kSmooth;
  Eigen::RowVectorXd level(columns.cols()), rate(columns.cols());
  double p00 = 0.0, p01 = 0.0, p11 = 0.0, log_det = 0.0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (next < starts.size() && i == starts[next]) {
      level.setZero();
      rate.setZero();
      p00 = p01 = p11 = 0.0;
      ++next;
    } else {
      const double h = order[i] - order[i - 1];
      if (smooth) {
        level += h * rate;
        p00 += h * (2.0 * p01 + h * p11) + ratio * h * h * h / 3.0;
        p01 += h * p11 + ratio * h * h / 2.0;
        p11 += ratio * h;
      } else {
        p00 += ratio * h;
      }
    }
    auto row = columns.row(static_cast<Eigen::Index>(i));
    const double f = p00 + 1.0, k0 = p00 / f, k1 = p01 / f;
    row -= level;
    level += k0 * row;
    if (smooth) rate += k1 * row;
    row /= std::sqrt(f);
    log_det += std::log(f);
    p11 -= k1 * p01;
    p01 -= k0 * p01;
    p00 -= k0 * p00;
  }
  return log_det;
}

double covariance(DriftShape shape, double s, double t, double origin) {
  const double low = std::min(s, t) - origin, high = std::max(s, t) - origin;
  if (low <= 0.0) return s == t && low < 0.0 ? covariance(shape, -low, -low, 0.0) : 0.0;
  if (shape == DriftShape::kRandomWalk) return low;
  if (shape == DriftShape::kSmooth) return low * low * (3.0 * high - low) / 6.0;
  return 0.0;
}

bool hasSlope(DriftShape shape) {
  return shape == DriftShape::kLinear || shape == DriftShape::kSmooth;
}

void fillOwnEffects(DriftShape shape, const std::vector<double>& order,
                    const std::vector<std::size_t>& starts, double at, std::size_t recording,
                    Eigen::Ref<Eigen::VectorXd> row) {
  row.setZero();
  const auto r = static_cast<Eigen::Index>(recording);
  const auto count = static_cast<Eigen::Index>(starts.size());
  row[r] = 1.0;
  if (!hasSlope(shape)) return;
  const double first = order[starts[recording]], last = recordingEnd(order, starts, recording);
  row[count + r] = (at - 0.5 * (first + last)) / std::max(0.5 * (last - first), 1e-12);
}

}  // namespace assembly_cell::bias_series
