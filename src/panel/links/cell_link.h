// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "cell_view.h"

namespace assembly_cell::panel {

/// A cell through ROS: hears its topics in a thread of its own, sends goals, calls services in
/// threads of their own. Nothing here waits. Needs ros::init.
class CellLink {
 public:
  CellLink();
  ~CellLink();
  CellLink(const CellLink&) = delete;
  CellLink& operator=(const CellLink&) = delete;

  CellView view();

  void start(const GoalRequest& goal);
  /// Whatever goal the supervisor works on, whoever has sent it.
  void cancel();
  void retreat();

  void zero(Sensor sensor);
  void undoBias(Sensor sensor);

  void pause(bool paused);
  void step(std::uint32_t blocks);
  void reset();

  void askPlan(const std::string& plan);
  void beginCalibration(const CalibrationRequest& request);
  void cancelCalibration();
  /// The load that the action waits for is on. Of the step `step` of the plan.
  void confirmLoad(const Measured& measured);
  void removeLast();
  void askStored();
  void loadCalibration(const std::string& id);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace assembly_cell::panel
