// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace assembly_cell::ros_bridge {

/// Age of a stamp [s]; 0 for a stamp in the future.
inline double age(const ros::Time& time) {
  return std::max(0.0, (ros::Time::now() - time).toSec());
}

/// ROS time (the system clock) of points of the steady clock. A step of the system clock is taken
/// over at once and counted; an offset that was read while the process was interrupted isn't used.
class RosClock {
 public:
  using Steady = std::chrono::steady_clock;

  /// ROS time of `point`, by the offset of the two clocks now.
  ros::Time at(Steady::time_point point);

  std::uint64_t steps() const { return steps_; }                              ///< of more than 5 ms
  double lastStep() const { return 1e-9 * static_cast<double>(last_step_); }  ///< [s]

 private:
  bool known_ = false;
  std::int64_t offset_ = 0;  // system − steady [ns]
  std::uint64_t steps_ = 0;
  std::int64_t last_step_ = 0;  // [ns]
};

/// The latest 16384 delays.
class Delays {
 public:
  void add(double delay) {
    delays_[next_] = delay;
    next_ = (next_ + 1) % delays_.size();
    if (count_ < delays_.size()) ++count_;
  }
  std::size_t count() const { return count_; }
  double percentile(double fraction) const;  ///< [s]; 0 without any

 private:
  std::array<double, 16384> delays_{};
  std::size_t next_ = 0, count_ = 0;
};

}  // namespace assembly_cell::ros_bridge
