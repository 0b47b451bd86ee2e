// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/CalibrationTest.h"
#include "assembly_cell/LoadStep.h"
#include "cell_view.h"
#include "errands.h"

namespace assembly_cell::panel {

/// The part of CellLink that speaks with calibration_server.
class CalibrationLink {
 public:
  /// nh: of the cell, with the queue that is spun.
  CalibrationLink(const ros::NodeHandle& nh, Errands& errands);

  /// Subscribes.
  void begin();
  CalibrationView view() const;

  void askPlan(const std::string& plan);
  void run(const CalibrationRequest& request);
  void cancel();
  void confirm(const Measured& measured);
  void removeLast();
  void askStored();
  void load(const std::string& id);

 private:
  void conclude(bool success, const std::string& text);
  /// Step of the plan whose load the action waits for; −1: it isn't known.
  int awaited() const;

  ros::NodeHandle nh_;
  Errands& errands_;
  mutable std::mutex mutex_;
  CalibrationView view_;
  Clock::time_point running_since_;
  std::vector<LoadStep> steps_;  // of the plan that is shown
  ros::Subscriber status_sub_, feedback_sub_, result_sub_;
  ros::Publisher goal_pub_, cancel_pub_;
};

}  // namespace assembly_cell::panel
