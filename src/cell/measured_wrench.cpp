// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/measured_wrench.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

// with the transformation into the frame of the true sensor
Matrix6 mapOf(const SensorTruth& truth) {
  const Pose frame{rotationFromVector({truth.rotation}), truth.offset};
  return truth.gain() * wrenchTransform(inverse(frame));
}

}  // namespace

MeasuredWrench::MeasuredWrench(const SensorTruth& truth, double period)
    : truth_(truth), period_(period), map_(mapOf(truth)), normal_(truth.walk_seed) {
  exact_ = map_ == Matrix6::Identity() && truth.drift.isZero(0.0) && truth.walk == 0.0 &&
           truth.hum.isZero(0.0) && truth.latency == 0.0;
  if (truth.latency == 0.0) return;
  // a cubic through the four samples about the time, or through the newest four
  const double delay = truth.latency / period;
  back_ = static_cast<std::size_t>(std::max(0.0, std::floor(delay) - 1.0));
  const double u = delay - static_cast<double>(back_);
  weights_[0] = -(u - 1) * (u - 2) * (u - 3) / 6;
  weights_[1] = u * (u - 2) * (u - 3) / 2;
  weights_[2] = -u * (u - 1) * (u - 3) / 2;
  weights_[3] = u * (u - 1) * (u - 2) / 6;
  past_.resize(back_ + 4);
}

Vector6 MeasuredWrench::late(const Vector6& w) {
  if (past_.empty()) return w;
  if (!filled_) std::fill(past_.begin(), past_.end(), w);
  filled_ = true;
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = w;
  Vector6 sum = Vector6::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    sum += weights_[i] * past_[(newest_ + past_.size() - back_ - i) % past_.size()];
  }
  return sum;
}

Vector6 MeasuredWrench::operator()(const Vector6& w, double time) {
  if (exact_) return w;
  Vector6 measured = map_ * late(w);
  constexpr double kMinute = 60.0;
  measured += time / kMinute * truth_.drift;
  if (truth_.walk > 0.0) {
    const double step = truth_.walk * std::sqrt(period_ / kMinute);
    for (int i = 0; i < 6; ++i) walk_(i) += (i < 3 ? step : step * SensorTruth::kLever) * normal_();
    measured += walk_;
  }
  measured.head<3>() +=
      std::sin(2 * M_PI * truth_.hum_frequency * time + truth_.hum_phase) * truth_.hum;
  return measured;
}

}  // namespace assembly_cell
