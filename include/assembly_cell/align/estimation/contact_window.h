// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <vector>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Mean and covariance of a block of wrench samples. [N], [N·m]
struct BlockMoments {
  Vector6 mean = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();  ///< of one sample about the mean
  int count = 0;
};

/// Moments of 6 × n numbers, sample after sample.
BlockMoments momentsOf(const double* samples, std::size_t n);

/// Covariance that rounding to a converter's step [V] adds to every reading, S (q²/12) Sᵀ. The mean
/// of many samples keeps it: a load at rest is rounded alike each time.
Matrix6 roundingCovariance(const Matrix6& volts_to_wrench, double step);

/// Wrench of the peg's weight at sensor_b, in the carrier's axes about its origin. up: against
/// gravity, carrier axes; displacement: of the coupling, x y z [m], rotation vector [rad].
Vector6 pegWeight(const PegParameters& peg, double gravity, const Eigen::Vector3d& up,
                  const Vector6& displacement);

/// Wrenches of both sensors at rest: means of a window with their covariance.
class ContactWindow {
 public:
  void clear() { *this = ContactWindow(); }
  void add(const BlockMoments& a, const BlockMoments& b, const Vector6& displacement);

  std::size_t blocks() const { return entries_.size(); }
  int samples() const { return samples_; }
  /// The means of both halves agree within 5 sd of white noise plus a tolerance [N], for moments
  /// `lever` [m] times it. False for fewer than two blocks.
  bool settled(double tolerance, double lever = 0.1) const;

  const Vector6& wrenchA() const { return wrench_a_; }
  const Vector6& wrenchB() const { return wrench_b_; }
  const Vector6& displacement() const { return displacement_; }
  /// Covariance of the window's mean, from the scatter of the samples.
  Matrix6 covarianceA() const { return scatter_a_ / samples_; }
  Matrix6 covarianceB() const { return scatter_b_ / samples_; }

 private:
  struct Entry {
    Vector6 a, b;
  };
  std::vector<Entry> entries_;
  int samples_ = 0;
  Vector6 wrench_a_ = Vector6::Zero(), wrench_b_ = Vector6::Zero();
  Vector6 displacement_ = Vector6::Zero();
  Matrix6 scatter_a_ = Matrix6::Zero(), scatter_b_ = Matrix6::Zero();  // mean of the blocks'
};

}  // namespace assembly_cell
