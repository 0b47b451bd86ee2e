// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/averaging_window.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

// A turn counts as the way of a point so far from the carrier's origin [m]: about the peg's length.
// Half or twice doubles or halves the turn that a window may have.
constexpr double kLever = 0.1;

}  // namespace

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
  // for a strategy the press itself looks after saturation and motion
  if (std::isfinite(limits_.carrier_motion)) {
    if (block.saturated) return State::kSaturated;
    const Pose carrier = poseFromRest(block.carrier);
    if (means_.blocks() == 1) first_carrier_ = carrier;
    const Eigen::Matrix3d turn = first_carrier_.R.transpose() * carrier.R;
    motion_ = std::max(motion_, (carrier.p - first_carrier_.p).norm() +
                                    kLever * vectorFromRotation(turn).value.norm());
    if (motion_ > limits_.carrier_motion) return State::kMoved;
  }
  if (blocks() < limits_.blocks) return State::kFilling;
  if (blocks() == 1 || means_.settled(limits_.settled_force)) return State::kSettled;
  if (++tried_ >= limits_.tries) return State::kNotSettled;
  means_.clear();
  motion_ = 0.0;
  return State::kFilling;
}

}  // namespace assembly_cell
