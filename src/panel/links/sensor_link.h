// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <array>
#include <mutex>
#include <string>
#include <vector>

#include "cell_view.h"
#include "locked_subscriber.h"

namespace assembly_cell::panel {

/// Wrenches and calibrations of the sensors, and the last measurement of the estimators.
class SensorLink {
 public:
  explicit SensorLink(const ros::NodeHandle& nh);
  /// Fills in sensors and reading.
  void show(CellView& view) const;

 private:
  mutable std::mutex mutex_;
  LockedSubscriber topics_;
  std::array<SensorView, 2> sensors_;
  std::string reading_;
  Clock::time_point reading_time_;
  std::array<ros::Subscriber, 2> wrench_subs_;
  std::vector<ros::Subscriber> subs_;
};

}  // namespace assembly_cell::panel
