// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <array>
#include <string>

#include "assembly_cell/SetState.h"
#include "assembly_cell/Step.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/simulation/simulator_loop.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"

namespace assembly_cell::ros_bridge {

/// Services of the simulator: ~pause, ~step, ~reset, ~set_state, in threads of their own.
class SimulatorServices {
 public:
  /// All are referred to.
  SimulatorServices(const ros::NodeHandle& pnh, const SimulatorSettings& settings,
                    const SimulatorSetup& setup, SimulatorState& state, SimulatorLoop& loop);
  /// The loop must have been stopped before, or calls wait for it.
  ~SimulatorServices() { spinner_.stop(); }

 private:
  bool onPause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool onStep(Step::Request& request, Step::Response& response);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onSetState(SetState::Request& request, SetState::Response& response);
  void refuseBesideAnArm(const char* what) const;
  std::string time() const;

  const SimulatorSettings& settings_;
  const SimulatorSetup& setup_;
  SimulatorState& state_;
  SimulatorLoop& loop_;
  ros::CallbackQueue queue_;
  std::array<ros::ServiceServer, 4> servers_;
  GuardedSpinner spinner_{3, &queue_};  // a pause ends a step that is under way
};

}  // namespace assembly_cell::ros_bridge
