// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/averaging_window.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

// A rotation counts as the displacement of a point so far from the carrier's origin [m]: about the
// peg's length. Half or twice doubles or halves the rotation that a window may have.
constexpr double kLever = 0.1;

// Blocks from which on scatter of encoders can be distinguished from motion, ...
constexpr int kMinBlocks = 6;
// ... which is a displacement beyond so many standard deviations. Of 10 blocks that only scatter 1
// window in 5000 is refused where one standard deviation is twice the limit, and 95 % of those with
// a step of five; with one less of both 1 in 20 and all, with one more none and 25 %.
constexpr double kScatters = 3.5, kHalvesScatter = 2.5;
// A carrier with more scatter than this isn't held [m].
constexpr double kMaxScatter = 2e-4;

// Length of a displacement and of a small rotation, from an upright carrier [m].
double lengthOf(const Vector6& d) { return d.head<3>().norm() + kLever * d.tail<3>().norm(); }

}  // namespace

// The first block against all others, and the halves' means against each other: where all only
// scatter, both differ by as much as neighbours.
bool AveragingWindow::hasMoved() {
  const std::size_t n = displacements_.size(), half = n / 2;
  motion_ = 0.0;
  for (const Vector6& d : displacements_) motion_ = std::max(motion_, lengthOf(d));
  if (motion_ <= limits_.carrier_motion) return false;
  if (n < kMinBlocks) return true;
  // neighbours without the steady part of their difference: 2σ² each
  Vector6 squares = Vector6::Zero(), first = Vector6::Zero(), second = Vector6::Zero();
  const double steps = static_cast<double>(n - 1);
  const Vector6 steady = (displacements_.back() - displacements_.front()) / steps;
  for (std::size_t i = 1; i < n; ++i) {
    squares += (displacements_[i] - displacements_[i - 1] - steady).cwiseAbs2();
  }
  const double sd = lengthOf((squares / (2.0 * (steps - 1.0 / steps))).cwiseSqrt());
  if (motion_ > limits_.carrier_motion + std::min(kScatters * sd, kMaxScatter)) return true;
  for (std::size_t i = 0; i < half; ++i) {
    first += displacements_[i];
    second += displacements_[n - 1 - i];
  }
  const double count = static_cast<double>(half);
  // the halves' means of a steady motion differ by half of it
  const double drift = 2.0 * lengthOf((second - first) / count);
  return drift > limits_.carrier_motion + 2.0 * kHalvesScatter * sd * std::sqrt(2.0 / count);
}

RestPose AveragingWindow::carrier() const {
  const double n = std::max(1, blocks());
  return {origin_.x + sum_(0) / n,   origin_.y + sum_(1) / n,     origin_.z + sum_(2) / n,
          origin_.yaw + sum_(3) / n, origin_.theta + sum_(4) / n, origin_.phi + sum_(5) / n};
}

double AveragingWindow::positionVariance() const {
  const double n = blocks();
  return n < 2 ? 0.0 : std::max(0.0, squares_(2) - sum_(2) * sum_(2) / n) / (n * (n - 1));
}

double AveragingWindow::rotationVariance() const {
  const double n = blocks();
  if (n < 2) return 0.0;
  const auto tilts = [n](double sum, double squares) {
    return std::max(0.0, squares - sum * sum / n) / (n * (n - 1));
  };
  return 0.5 * (tilts(sum_(4), squares_(4)) + tilts(sum_(5), squares_(5)));
}

AveragingWindow::State AveragingWindow::add(const PlantBlock& block) {
  const RestPose& at = block.carrier;
  if (means_.blocks() == 0) {
    first_end_ = block.time;
    origin_ = at;
    sum_.setZero();
    squares_.setZero();
  }
  Vector6 off;
  off << at.x - origin_.x, at.y - origin_.y, at.z - origin_.z, at.yaw - origin_.yaw,
      at.theta - origin_.theta, at.phi - origin_.phi;
  sum_ += off;
  squares_ += off.cwiseAbs2();
  means_.add({block.wrench_a, block.covariance_a, block.samples},
             {block.wrench_b, block.covariance_b, block.samples}, block.displacement_b);
  last_ = block;
  // in a strategy the press checks saturation and motion
  if (std::isfinite(limits_.carrier_motion)) {
    if (block.saturated) return State::kSaturated;
    displacements_.push_back(off);
  }
  if (blocks() < limits_.blocks) return State::kFilling;
  if (std::isfinite(limits_.carrier_motion) && hasMoved()) return State::kMoved;
  if (blocks() == 1 || means_.settled(limits_.settled_force)) return State::kSettled;
  if (++tried_ >= limits_.tries) return State::kNotSettled;
  means_.clear();
  displacements_.clear();
  return State::kFilling;
}

}  // namespace assembly_cell
