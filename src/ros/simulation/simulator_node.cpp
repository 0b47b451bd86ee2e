// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>

#include <memory>
#include <string>
#include <utility>

#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/parameters.h"

namespace assembly_cell::ros_bridge {

SimulatorNode::SimulatorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : name_(pnh.getNamespace()),
      settings_(readSimulatorSettings(pnh)),
      setup_(loadSimulatorSetup(settings_, Parameters(nh).text("robot_description"))) {
  logSetup();
  auto cell = std::make_unique<SimulatedCell>(setup_.scenario, setup_.cell, setup_.X_HB);
  PlantGuard guard = plantGuard(settings_.limits, settings_.lease, settings_.lockstep);
  guard.braking = setup_.braking;
  guard.start = inverse(cell->carrier().base()) * poseFromRest(setup_.scenario.rest);
  state_ = std::make_unique<SimulatorState>(
      guard, settings_.lockstep ? ros::Time(1, 0) : ros::Time::now());
  state_->paused = settings_.paused;
  cell_ = std::make_unique<GuardedCell>(std::move(cell), settings_.follow_motion, state_->gate,
                                        state_->mutex, warn);
  output_ = std::make_unique<SimulatorOutput>(nh, settings_, setup_, *state_, *cell_);
  answers_ = std::make_unique<LockstepAnswers>(nh, settings_, *state_, [this] { loop_->goOn(); });
  loop_ = std::make_unique<SimulatorLoop>(settings_, *state_, *cell_, *output_, *answers_);
  inputs_ = std::make_unique<SimulatorInputs>(nh, settings_, *state_, *answers_);
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  diagnostics_timer_ = nh.createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { publishDiagnostics(); });
  ROS_INFO("%s: scenario %s, %s, %zu participants", name_.c_str(), settings_.scenario.c_str(),
           settings_.lockstep ? "lockstep" : "paced by the wall clock",
           settings_.lockstep ? settings_.participants.size() : 0);
  loop_->start();
  services_ = std::make_unique<SimulatorServices>(pnh, settings_, setup_, *state_, *loop_);
}

void SimulatorNode::logSetup() const {
  for (const std::string& pair : setup_.part_pairs) {
    ROS_WARN_NAMED("simulator", "%s can meet, but only peg and hole are searched for contact",
                   pair.c_str());
  }
  if (!setup_.peg_meets_hole) {
    ROS_INFO_NAMED("simulator", "peg and hole can't meet: no contact search");
  }
}

void SimulatorNode::publishDiagnostics() {
  const auto now = std::chrono::steady_clock::now();
  const double time = state_->now;
  const double wall = std::chrono::duration<double>(now - diagnosed_).count();
  const double factor = wall > 0.0 ? (time - diagnosed_time_) / wall : 0.0;
  diagnosed_ = now;
  diagnosed_time_ = time;

  diagnostic_msgs::DiagnosticStatus status;
  status.name = name_.substr(1) + ": simulation";
  status.hardware_id = "simulation";
  status.level = diagnostic_msgs::DiagnosticStatus::OK;
  std::string owner;
  CommandGate::Refusals refusals;
  {
    const std::lock_guard<std::mutex> lock(state_->mutex);
    const PlantGuard& guard = state_->gate.guard();
    status.message = state_->paused ? "paused" : "running";
    owner = guard.owner;
    refusals = state_->gate.refusals();
    if (guard.expired || guard.overloaded) {
      status.level = diagnostic_msgs::DiagnosticStatus::WARN;
      status.message = "held: " + state_->gate.stopReason();
    }
    if (!state_->stopped.empty()) {
      status.level = diagnostic_msgs::DiagnosticStatus::ERROR;
      status.message = "stopped: " + state_->stopped;
    }
  }
  publishStatus(diagnostics_pub_, status,
                {{"Simulated time [s]", std::to_string(time)},
                 {"Real-time factor", std::to_string(factor)},
                 {"Commands refused", std::to_string(refusals.commands)},
                 {"Last refusal", refusals.last.text},
                 {"Held by", owner}});
}

}  // namespace assembly_cell::ros_bridge
