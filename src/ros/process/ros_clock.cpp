// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/ros_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kTries = 5;
constexpr std::int64_t kSmoothing = 16;    // of the offset, whose noise is some hundred nanoseconds
constexpr std::int64_t kTight = 20'000;    // between the two clock readings of an offset [ns]
constexpr std::int64_t kStep = 5'000'000;  // beyond any slewing between two blocks [ns]

template <class Point>
std::int64_t nanoseconds(const Point& point) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(point.time_since_epoch()).count();
}

}  // namespace

ros::Time RosClock::at(Steady::time_point point) {
  std::int64_t offset = 0, tightest = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < kTries && tightest > kTight; ++i) {
    const std::int64_t before = nanoseconds(Steady::now());
    const std::int64_t system = nanoseconds(std::chrono::system_clock::now());
    const std::int64_t gap = nanoseconds(Steady::now()) - before;
    if (gap < tightest) {
      tightest = gap;
      offset = system - before - gap / 2;
    }
  }
  if (!known_) {
    known_ = true;
    offset_ = offset;
  } else if (std::abs(offset - offset_) > std::max(kStep, tightest)) {
    ++steps_;
    last_step_ = offset - offset_;
    offset_ = offset;
  } else if (tightest <= kTight) {
    offset_ += (offset - offset_) / kSmoothing;
  }
  ros::Time time;
  const std::int64_t stamp = std::max<std::int64_t>(nanoseconds(point) + offset_, 0);
  return time.fromNSec(static_cast<std::uint64_t>(stamp));
}

double Delays::percentile(double fraction) const {
  if (count_ == 0) return 0.0;
  auto sorted = delays_;
  const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto rank = static_cast<std::ptrdiff_t>(std::min(
      static_cast<double>(count_ - 1), std::ceil(fraction * static_cast<double>(count_)) - 1.0));
  std::nth_element(sorted.begin(), sorted.begin() + std::max<std::ptrdiff_t>(rank, 0), end);
  return sorted[static_cast<std::size_t>(std::max<std::ptrdiff_t>(rank, 0))];
}

}  // namespace assembly_cell::ros_bridge
