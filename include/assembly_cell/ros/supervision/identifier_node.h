// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/IdentifyAction.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/align/search/guarded_carrier.h"
#include "assembly_cell/identification/measure.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell::ros_bridge {

/// Node mechanism_identifier: finds by shaking and pressing what the mechanism's numbers are, and
/// stores them with their covariance. It holds the plant while a goal runs, as the supervisor does
/// for its own; the plant's guard refuses the second of both. See docs/reference/interfaces.md.
class IdentifierNode {
 public:
  /// Of the data; goals have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or scenario.
  IdentifierNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~IdentifierNode();

  /// Ends the goal under way as a cancel does: exciter off, the peg freed. Returns when it has
  /// ended.
  void stop();

 private:
  using Server = CheckedActionServer<IdentifyAction>;

  void execute(const IdentifyGoalConstPtr& goal);
  /// Throws PlantError, AlignError, InputError.
  void identifyInto(const IdentifyGoal& goal, IdentifyResult& result);
  /// After a goal that failed, if there is anything to feel with. True: nothing presses any more.
  /// hung_free: the peg, when the goal began.
  bool free(bool hung_free);
  SupervisorState peg();
  void hearSupervisor(const SupervisorState& supervisor);
  void tellPeg(const std::string& goal, bool in_contact, const std::string& reason);

  Mechanism mechanism_;  ///< as drawn
  std::string scenario_, file_;
  double prior_scale_ = 1.0;
  PressLimits limits_;
  std::unique_ptr<RosPlant> plant_;
  std::mutex busy_;  ///< held by the goal that runs
  std::mutex state_mutex_;
  SupervisorState state_;  ///< of the peg, by the last goal that moved it, the supervisor's as well
  ros::Publisher state_pub_, mechanism_pub_;
  ros::Subscriber supervisor_sub_;
  std::unique_ptr<Server> server_;
};

}  // namespace assembly_cell::ros_bridge
