// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/CalibrationTest.h"
#include "assembly_cell/LoadStep.h"
#include "cell_view.h"
#include "locked_subscriber.h"
#include "requests/async_requests.h"

namespace assembly_cell::panel {

/// Topics, action and services of calibration_server.
class CalibrationLink {
 public:
  /// nh: of the cell, with the queue that is spun.
  CalibrationLink(const ros::NodeHandle& nh, AsyncRequests& requests);
  CalibrationView view() const;

  void requestPlan(const std::string& plan);
  void start(const CalibrationRequest& request);
  void cancel();
  void confirm(const Measured& measured);
  void removeLast();
  void requestStored();
  void load(const std::string& id);

 private:
  /// Step of the plan whose load the action waits for; −1: unknown.
  int awaitedStep() const;

  AsyncRequests& requests_;
  mutable std::mutex mutex_;
  LockedSubscriber topics_;
  CalibrationView view_;
  Clock::time_point running_since_;
  std::vector<LoadStep> steps_;  // of the plan that is shown
  ros::Subscriber status_sub_, feedback_sub_, result_sub_;
  ros::Publisher goal_pub_, cancel_pub_;
};

}  // namespace assembly_cell::panel
