// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <memory>

#include "cell_view.h"

namespace assembly_cell::panel {

/// A cell through ROS: subscribes in a thread of its own, sends goals, calls services in threads of
/// their own. No function waits. Needs ros::init.
class CellLink {
 public:
  CellLink();
  ~CellLink();
  CellLink(const CellLink&) = delete;
  CellLink& operator=(const CellLink&) = delete;

  CellView view();

  void start(const GoalRequest& goal);
  void cancel();  ///< the supervisor's goal, of any client
  void retreat();

  void zero(Sensor sensor);
  void undoBias(Sensor sensor);

  void pause(bool paused);
  void step(std::uint32_t blocks);
  void reset();

  void requestPlan(const std::string& plan);
  void startCalibration(const CalibrationRequest& request);
  void cancelCalibration();
  /// The load that the action waits for is applied.
  void confirmLoad(const Measured& measured);
  void removeLast();
  void requestStored();
  void loadCalibration(const std::string& id);

 private:
  struct Links;
  std::unique_ptr<Links> links_;
};

}  // namespace assembly_cell::panel
