// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/align/align.h"
#include "assembly_cell/align/search/guarded_carrier.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/static_frames.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell::ros_bridge {

/// Node assembly_supervisor: runs the strategies over the cell through ROS. It alone moves
/// anything. One goal at a time. See docs/reference/interfaces.md.
class SupervisorNode {
 public:
  /// Of the data; goals have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or scenario.
  SupervisorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~SupervisorNode();

  /// Ends the goal under way as a cancel does: exciter off, the peg freed. Returns when it has
  /// ended.
  void stop();

 private:
  using AlignServer = CheckedActionServer<AlignPegAction>;
  using AssembleServer = CheckedActionServer<AssemblePegAction>;
  using ContactServer = CheckedActionServer<MoveToContactAction>;
  using RetreatServer = CheckedActionServer<RetreatAction>;

  void executeAlign(const AlignPegGoalConstPtr& goal);
  void executeAssemble(const AssemblePegGoalConstPtr& goal);
  /// Of both: runs the strategy and what follows it; `name` is the goal's.
  AlignResult runStrategy(const std::string& name, AlignParameters parameters,
                          const std::function<bool()>& cancelled,
                          const std::function<void(const AlignProgress&)>& progress,
                          AlignmentReport& answer);
  void executeContact(const MoveToContactGoalConstPtr& goal);
  void executeRetreat(const RetreatGoalConstPtr& goal);
  AlignmentReport report(const AlignResult& result, double wall_time) const;

  /// Of a goal that begins: what is in force now holds until its end.
  LiveValues takeLive();

  // what is known of the mechanism (supervisor_mechanism.cpp)
  void readMechanism(Parameters& parameters);
  /// Begins a goal over the plant with a mechanism that the hanging peg does not contradict;
  /// identifies it first where that is allowed and needed. Null: as drawn. Throws AlignError
  /// `wrong_mechanism`, PlantError.
  const KnownMechanism* beginKnown(const std::string& strategy,
                                   const std::function<bool()>& cancelled,
                                   const std::function<void(const AlignProgress&)>& progress);
  /// By the node mechanism_identifier, which holds the plant meanwhile. Throws PlantError.
  void identifyMechanism(const std::function<bool()>& cancelled);
  /// Of what is known by the hanging peg; empty: none.
  std::string contradiction();
  void goBy(KnownMechanism known);
  void goByNews();  ///< by what mechanism_identifier found since, for whom ever

  // state and freeing of the peg (supervisor_state.cpp)
  void startState(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  /// A goal begins. Throws InputError `in_contact` when it needs a free peg and the last one got
  /// stuck.
  void enter(const std::string& goal, bool needs_free_peg);
  /// How a goal has ended.
  struct End {
    bool failed = false;
    bool begun = false;     ///< something may have moved
    bool pressing = false;  ///< the peg is meant to stay in contact
    bool freed = false;     ///< freeing it was the goal: once is enough
    bool stuck = false;
    int contacts = 0;  ///< readings taken until the plant failed
    AlignFailure failure = AlignFailure::kNone;
    std::string reason;
  };
  /// Of the exception that is being handled.
  End endOfException() const;
  bool hasBegun(AlignFailure failure) const;
  /// A goal has ended. Where it failed the peg is freed first, if there is anything to feel with.
  void leave(const End& end);
  void tell(bool in_contact, bool stuck, const std::string& reason);
  /// Depth of the peg in the hole where the last goal left it, less what its carrier has moved out
  /// since; 0 where that isn't the way along the bore. [m]
  double inserted() const;
  void hearIdentifier(const SupervisorState& identifier);
  void hearPlant(const PlantState& plant);
  void publishState();
  SupervisorState told() const;  ///< by state_mutex_
  void publishDiagnostics();

  ros::NodeHandle nh_;
  std::string name_;
  Mechanism mechanism_;  ///< nominal parts, or as identified
  std::optional<KnownMechanism> known_;
  std::optional<KnownMechanism> news_;  ///< by state_mutex_, until the next goal begins
  bool identify_ = false;        ///< where none is known and one is needed, or it is contradicted
  double identify_time_ = 60.0;  ///< [s]
  double slow_factor_ = 1.0;     ///< of the waits for other nodes
  Pose X_CP_;                    ///< peg in the carrier, at rest
  AlignParameters parameters_;   ///< at the start
  PressLimits limits_;           ///< by busy_, of the goal that runs
  struct LeftIn {
    double depth = 0.0;  ///< of the peg's edge in the hole [m]
    Pose carrier;        ///< that held it there
  };
  LeftIn left_in_;           ///< by busy_, of the last goal
  bool began_free_ = false;  ///< the peg, as far as is known, when the goal began
  std::unique_ptr<LiveSettings> live_;

  std::unique_ptr<RosPlant> plant_;
  std::mutex busy_;  ///< held by the goal that runs
  std::mutex state_mutex_;
  SupervisorState state_;
  bool identifier_runs_ = false;  ///< by state_mutex_, as heard last
  ros::Time identified_;          ///< by state_mutex_: whose end state_ is of, if the identifier's
  ros::Publisher state_pub_, diagnostics_pub_;
  ros::Subscriber identifier_sub_, plant_sub_, mechanism_sub_;
  ros::WallTimer diagnostics_timer_;
  ros::Publisher report_pub_;
  StaticFrames frames_;
  std::unique_ptr<AlignServer> align_server_;
  std::unique_ptr<AssembleServer> assemble_server_;
  std::unique_ptr<ContactServer> contact_server_;
  std::unique_ptr<RetreatServer> retreat_server_;
};

}  // namespace assembly_cell::ros_bridge
