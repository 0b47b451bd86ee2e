// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/IdentifyAction.h"
#include "assembly_cell/align/search/guarded_carrier.h"
#include "assembly_cell/identification/measure.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/supervision/peg_state.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct IdentifierSettings {
  std::string scenario;                      ///< file of the cell
  std::string file;                          ///< result of goals that name none; empty: not stored
  double prior_scale = 1.0;                  ///< of the drawing's standard deviations
  double force_limit = PressLimits().force;  ///< [N]
};
void fields(FieldList& f, IdentifierSettings& s);

/// Node mechanism_identifier: identifies the parameters of the mechanism by exciting and pressing
/// the peg, and stores them with their covariance. It owns the plant while a goal runs, as the
/// supervisor does for its goals. Interfaces: docs/reference/nodes/mechanism_identifier.md.
class IdentifierNode {
 public:
  /// Threads of the data's callbacks; goals have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or scenario.
  IdentifierNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~IdentifierNode();

  /// Ends the active goal as a cancel does: exciter off, the peg freed. Returns when it has ended.
  void stop();

 private:
  using Server = CheckedActionServer<IdentifyAction>;

  void execute(const IdentifyGoalConstPtr& goal);
  /// Throws PlantError, AlignError, InputError.
  void identifyInto(const IdentifyGoal& goal, IdentifyResult& result);
  void identifyArmInto(const IdentifyGoal& goal, IdentifyResult& result);
  void publish(const IdentificationProgress& now);
  /// Frees the peg after a failed goal if there are data to detect contact by, and ends the plant's
  /// goal. was_free: at the goal's start. Returns whether the peg is free.
  bool release(bool was_free);
  void onSupervisor(const SupervisorState& supervisor);
  void setPeg(const std::string& goal, bool in_contact, const std::string& reason);

  IdentifierSettings settings_;
  Mechanism mechanism_;  ///< as drawn
  PressLimits limits_;
  std::unique_ptr<RosPlant> plant_;
  std::unique_ptr<PegState> peg_;  ///< by the last goal that moved it, here or of the supervisor
  std::mutex busy_;                ///< owned by the active goal
  ros::Publisher mechanism_pub_;
  ros::Subscriber supervisor_sub_;
  std::unique_ptr<Server> server_;
};

}  // namespace assembly_cell::ros_bridge
