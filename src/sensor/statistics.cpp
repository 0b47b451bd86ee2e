// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell {

void Moments::add(const Vector6& x) {
  ++count_;
  const Vector6 delta = x - mean_;
  mean_ += delta / static_cast<double>(count_);
  squares_ += delta.cwiseProduct(x - mean_);
}

Vector6 Moments::sd() const {
  if (count_ < 2) return Vector6::Zero();
  return (squares_ / static_cast<double>(count_ - 1)).cwiseSqrt();
}

void DifferenceNoise::add(const Vector6& x) {
  if (has_last_) {
    squares_ += (x - last_).cwiseAbs2();
    ++count_;
  }
  last_ = x;
  has_last_ = true;
}

void DifferenceNoise::clear() {
  count_ = 0;
  squares_.setZero();
}

Vector6 DifferenceNoise::rms() const {
  if (count_ == 0) return Vector6::Zero();
  return (squares_ / (2.0 * static_cast<double>(count_))).cwiseSqrt();
}

Arrival SequenceMonitor::accept(std::uint32_t sequence) {
  constexpr std::int32_t kReorderWindow = 100;  // a publisher's queue
  if (!started_) {
    started_ = true;
    last_ = sequence;
    return Arrival::kNext;
  }
  const auto step = static_cast<std::int32_t>(sequence - last_);
  // forward: one is right, more is a loss
  if (step > 0) {
    last_ = sequence;
    lost_ += static_cast<std::uint64_t>(step - 1);
    return step == 1 ? Arrival::kNext : Arrival::kLoss;
  }
  // back: a new count, or a block that was seen before
  if (step < -kReorderWindow || (step < 0 && sequence <= 1)) {
    last_ = sequence;
    ++restarts_;
    return Arrival::kRestart;
  }
  ++duplicates_;
  return Arrival::kDuplicate;
}

}  // namespace assembly_cell
