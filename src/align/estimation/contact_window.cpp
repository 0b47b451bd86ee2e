// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/contact_window.h"

#include <cmath>

namespace assembly_cell {

BlockMoments momentsOf(const double* samples, std::size_t n) {
  BlockMoments m;
  m.count = static_cast<int>(n);
  if (n == 0) return m;
  for (std::size_t i = 0; i < n; ++i) m.mean += Vector6::Map(samples + 6 * i);
  m.mean /= static_cast<double>(n);
  if (n < 2) return m;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector6 d = Vector6::Map(samples + 6 * i) - m.mean;
    m.covariance.noalias() += d * d.transpose();
  }
  m.covariance /= static_cast<double>(n - 1);
  return m;
}

Matrix6 roundingCovariance(const Matrix6& volts_to_wrench, double step) {
  return step * step / 12.0 * volts_to_wrench * volts_to_wrench.transpose();
}

Vector6 pegWeight(const PegParameters& peg, double gravity, const Eigen::Vector3d& up,
                  const Vector6& displacement) {
  const Eigen::Vector3d force = -peg.mass * gravity * up;
  const Eigen::Matrix3d R = rotationFromVector({Eigen::Vector3d(displacement.tail<3>())});
  const Eigen::Vector3d center = displacement.head<3>() - peg.coupling_height * R.col(2);
  Vector6 w;
  w << force, center.cross(force);
  return w;
}

void ContactWindow::add(const BlockMoments& a, const BlockMoments& b, const Vector6& displacement) {
  // running means over the samples of all blocks
  const double weight = static_cast<double>(b.count) / (samples_ + b.count);
  wrench_a_ += weight * (a.mean - wrench_a_);
  wrench_b_ += weight * (b.mean - wrench_b_);
  displacement_ += weight * (displacement - displacement_);
  scatter_a_ += weight * (a.covariance - scatter_a_);
  scatter_b_ += weight * (b.covariance - scatter_b_);
  samples_ += b.count;
  entries_.push_back({a.mean, b.mean});
}

bool ContactWindow::settled(double tolerance, double lever) const {
  const std::size_t half = entries_.size() / 2;
  if (half == 0) return false;
  Vector6 change_a = Vector6::Zero(), change_b = Vector6::Zero();
  for (std::size_t i = 0; i < half; ++i) {
    const Entry& late = entries_[entries_.size() - 1 - i];
    change_a += late.a - entries_[i].a;
    change_b += late.b - entries_[i].b;
  }
  const auto n = static_cast<double>(half);
  const double samples = samples_ * n / static_cast<double>(entries_.size());  // of one half
  for (int i = 0; i < 6; ++i) {
    const double slack = tolerance * (i < 3 ? 1.0 : lever);
    const double limit_a = slack + 5.0 * std::sqrt(2.0 * scatter_a_(i, i) / samples);
    const double limit_b = slack + 5.0 * std::sqrt(2.0 * scatter_b_(i, i) / samples);
    if (std::abs(change_a(i)) > n * limit_a || std::abs(change_b(i)) > n * limit_b) return false;
  }
  return true;
}

}  // namespace assembly_cell
