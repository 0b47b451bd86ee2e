// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/CalibrateSensorsAction.h>
#include <assembly_cell/ConfirmLoad.h>
#include <ros/ros.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/calibration/calibration_operations.h"

namespace assembly_cell::ros_bridge {

/// Action `calibrate`: carries out a plan step by step, with the loads of a rig or of a person,
/// then solves and stores. Observations of an interrupted run of the same plan count.
class CalibrationAction {
 public:
  /// Goals are accepted from start() on. `operations` must outlive this.
  CalibrationAction(const ros::NodeHandle& nh, CalibrationOperations& operations);
  ~CalibrationAction() { shutdown(); }

  void start() { server_.start(); }
  /// Cancels the goal under way and waits for its end.
  void shutdown();
  /// Why a wait is to end: the server shuts down or the goal was cancelled; else empty.
  std::string stopReason() const;
  /// Service `confirm`: reads the step that waits for a person. Throws InputError.
  void confirm(const ConfirmLoad::Request& request, ConfirmLoad::Response& response);

 private:
  enum class Waiting { kNo, kOpen, kReading, kDone };

  void execute(const CalibrateSensorsGoalConstPtr& goal);
  CalibrateSensorsResult runPlan(const CalibrateSensorsGoal& goal);
  /// Steps of the goal's plan; `done`: ids of those that an interrupted run has observed.
  std::vector<LoadRequest> openPlan(const CalibrateSensorsGoal& goal, std::set<std::string>& done);
  /// Load, window, journal; or why the step has no observation. Throws InputError when the plan
  /// can't go on.
  CalibrationRefusal stepByRig(const LoadRequest& step);
  CalibrationRefusal stepByPerson(const LoadRequest& step);
  bool cancelled() const;
  void setWaiting(Waiting waiting);
  void publishFeedback(const std::string& state, const std::string& message);

  ros::NodeHandle nh_;
  CalibrationOperations& operations_;
  std::mutex mutex_;  ///< guards waiting_, awaited_ and feedback_
  std::condition_variable changed_;
  Waiting waiting_ = Waiting::kNo;
  Observation awaited_;  ///< of the step that a person applies the load of
  CalibrateSensorsFeedback feedback_;
  std::atomic<bool> stopping_{false};
  CheckedActionServer<CalibrateSensorsAction> server_;
};

}  // namespace assembly_cell::ros_bridge
