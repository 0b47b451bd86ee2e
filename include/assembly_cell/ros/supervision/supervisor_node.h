// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <functional>
#include <memory>
#include <string>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/align/align.h"
#include "assembly_cell/align/search/guarded_carrier.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/static_frames.h"
#include "assembly_cell/ros/records/run_recorder.h"
#include "assembly_cell/ros/supervision/goal_runner.h"
#include "assembly_cell/ros/supervision/known_mechanism.h"
#include "assembly_cell/ros/supervision/peg_state.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell::ros_bridge {

/// A goal align or assemble.
struct StrategyGoal {
  std::string name, id;
  std::string serial, program;  ///< for its record
  AlignParameters parameters;
  std::function<std::string()> preempted_by;  ///< a node; empty: not cancelled
  std::function<void(const AlignProgress&)> progress;
};

/// Node assembly_supervisor: runs the strategies over the cell through ROS, one goal at a time. No
/// other node moves anything meanwhile. Interfaces: docs/reference/nodes/assembly_supervisor.md.
class SupervisorNode {
 public:
  /// Threads of the data's callbacks; goals have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or scenario.
  SupervisorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~SupervisorNode();

  /// Ends the active goal as a cancel does: exciter off, the peg freed. Returns when it has ended.
  void stop();

 private:
  template <class Spec>
  using Server = std::unique_ptr<CheckedActionServer<Spec>>;

  void executeAlign(const AlignPegGoalConstPtr& goal);
  void executeAssemble(const AssemblePegGoalConstPtr& goal);
  void executeContact(const MoveToContactGoalConstPtr& goal);
  void executeRetreat(const RetreatGoalConstPtr& goal);
  /// Runs the strategy, records the run, fills and publishes the report.
  AlignResult runStrategy(const StrategyGoal& goal, AlignmentReport& report);
  /// Applies the live settings, which a goal keeps until its end.
  void takeLive(AlignParameters& parameters);

  AlignParameters parameters_;  ///< at the start
  PressLimits limits_;          ///< of the active goal
  InsertedPeg inserted_;        ///< by the last goal
  std::unique_ptr<MechanismKeeper> mechanism_;
  std::unique_ptr<LiveSettings> live_;
  std::unique_ptr<RosPlant> plant_;
  std::unique_ptr<PegState> peg_;
  std::unique_ptr<PegMonitor> peg_monitor_;
  std::unique_ptr<GoalRunner> goals_;
  std::unique_ptr<RunRecorder> recorder_;  ///< null: nothing is recorded
  ros::Publisher report_pub_;
  StaticFrames frames_;
  struct {
    Server<AlignPegAction> align;
    Server<AssemblePegAction> assemble;
    Server<MoveToContactAction> contact;
    Server<RetreatAction> retreat;
  } servers_;  // last: their threads use the rest
};

}  // namespace assembly_cell::ros_bridge
