// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <chrono>
#include <memory>
#include <string>

#include "assembly_cell/ros/simulation/lockstep_answers.h"
#include "assembly_cell/ros/simulation/simulator_inputs.h"
#include "assembly_cell/ros/simulation/simulator_loop.h"
#include "assembly_cell/ros/simulation/simulator_output.h"
#include "assembly_cell/ros/simulation/simulator_services.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"

namespace assembly_cell::ros_bridge {

/// Node peg_hole_simulator: the simulated cell in time, paced by the wall clock or in lockstep with
/// its participants. Services and commands take effect between two blocks. See
/// docs/reference/interfaces.md.
class SimulatorNode {
 public:
  /// Threads of the callbacks of commands and acks; services have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters, scenario or robot description.
  SimulatorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~SimulatorNode() { loop_->stop(); }

  /// 1 after a participant has failed to answer.
  int exitCode() const { return answers_->exitCode(); }

 private:
  void logSetup() const;
  void publishDiagnostics();

  const std::string name_;
  const SimulatorSettings settings_;
  const SimulatorSetup setup_;
  std::unique_ptr<SimulatorState> state_;
  std::unique_ptr<GuardedCell> cell_;
  std::unique_ptr<SimulatorOutput> output_;
  std::unique_ptr<LockstepAnswers> answers_;
  std::unique_ptr<SimulatorLoop> loop_;
  std::unique_ptr<SimulatorInputs> inputs_;
  std::unique_ptr<SimulatorServices> services_;
  ros::Publisher diagnostics_pub_;
  std::chrono::steady_clock::time_point diagnosed_ = std::chrono::steady_clock::now();
  double diagnosed_time_ = 0.0;  // node time then [s]
  ros::WallTimer diagnostics_timer_;
};

}  // namespace assembly_cell::ros_bridge
