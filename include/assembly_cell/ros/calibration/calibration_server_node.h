// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/AddObservation.h>
#include <assembly_cell/GetCalibrations.h>
#include <assembly_cell/LoadCalibration.h>
#include <assembly_cell/PlanCalibration.h>
#include <assembly_cell/SaveCalibration.h>
#include <assembly_cell/SolveCalibration.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <vector>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/calibration/calibration_action.h"
#include "assembly_cell/ros/calibration/calibration_operations.h"

namespace assembly_cell::ros_bridge {

/// Calibrates two sensors: plans tests, averages their strain, keeps every observation on disk,
/// solves, stores and activates calibrations. This class is the services; interfaces:
/// docs/reference/nodes/calibration_server.md.
class CalibrationServerNode {
 public:
  /// Threads for its callbacks: of the data. Services and the action have their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or a damaged journal.
  CalibrationServerNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~CalibrationServerNode();

 private:
  bool plan(PlanCalibration::Request& request, PlanCalibration::Response& response);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool addObservation(AddObservation::Request& request, AddObservation::Response& response);
  bool removeLast(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool confirm(ConfirmLoad::Request& request, ConfirmLoad::Response& response);
  bool solve(SolveCalibration::Request& request, SolveCalibration::Response& response);
  bool save(SaveCalibration::Request& request, SaveCalibration::Response& response);
  bool load(LoadCalibration::Request& request, LoadCalibration::Response& response);
  bool getCalibrations(GetCalibrations::Request&, GetCalibrations::Response& response);

  CalibrationOperations operations_;
  CalibrationAction action_;
  ros::CallbackQueue service_queue_;
  std::vector<ros::ServiceServer> services_;
  GuardedSpinner service_spinner_{4, &service_queue_};
};

}  // namespace assembly_cell::ros_bridge
