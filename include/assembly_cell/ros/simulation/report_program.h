// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/align/align.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// What is printed about an alignment besides the supervisor's report.
struct ReportDetails {
  std::string strategy;
  double peg_radius = 0.0, hole_radius = 0.0;  ///< [m]
  double chamfer_height = 0.0;                 ///< of the peg [m]
  double chamfer_depth = 0.0;                  ///< of the hole [m]
  std::optional<Pose> truth_start, truth_end;  ///< X_HP
  double insert = 0.0;               ///< depth that the peg was to reach; 0: aligned only [m]
  bool floor = false;                ///< that depth is the hole's: down to its floor
  double depth = 0.0, force = 0.0;   ///< of the insertion, measured [m] [N]
  std::vector<BoreReading> profile;  ///< of the descent
  std::string mismatch;              ///< what was drawn for the truth, YAML; empty: nothing
};

/// Adds the truth to the report.
void addTruth(AlignmentReport& report, const ReportDetails& details);

/// True when the supervisor succeeded and the truth, if known, agrees.
bool verdict(const AlignmentReport& report, const ReportDetails& details);

/// For people, and for scripts.
std::string table(const AlignmentReport& report, const ReportDetails& details);
std::string yaml(const AlignmentReport& report, const ReportDetails& details);

/// Parameters of the program.
struct ReportSettings {
  std::string strategy;     ///< of the alignment
  std::string report_file;  ///< written; empty: none
  std::string simulator = "peg_hole_simulator";
  bool unpause = true;
  double timeout = 600.0;       ///< of the alignment, wall clock [s]
  double start_timeout = 60.0;  ///< of the nodes that must be there first, wall clock [s]

  ReportSettings();
};
void fields(FieldList& f, ReportSettings& s);

/// Program report: has the supervisor align the peg, reads the ground truth before and after, and
/// prints both.
class ReportProgram {
 public:
  /// Throws InputError for bad parameters.
  ReportProgram(ros::NodeHandle& nh, ros::NodeHandle& pnh);

  /// 0 aligned (and the truth agrees), 1 not.
  int run();

 private:
  template <class Action>
  using Client = actionlib::SimpleActionClient<Action>;

  /// Waits in wall time; one error line and false when `ready` doesn't come true.
  bool waitForCell(const std::string& what, const std::function<bool()>& ready) const;
  bool waitFor(const std::string& what, double timeout, const std::function<bool()>& ready) const;
  /// First truth at or after a time, of those in memory; the newest for time 0.
  std::optional<Pose> truthAt(const ros::Time& stamp) const;
  /// Waits for it; one error line and false when it doesn't come. True if it is not published.
  bool readTruth(const ros::Time& stamp, std::optional<Pose>& truth) const;
  /// Waits for supervisor and simulator, and finds out whether the ground truth is published.
  bool othersAreThere();
  /// Sends the goal, lets the simulator run and waits for its result_.
  template <class ActionClient, class Goal, class Result>
  bool carryOut(ActionClient& client, const Goal& goal, Result& result);
  bool carryOut();
  bool serverIsThere() const;

  ros::NodeHandle nh_;
  ReportSettings settings_;
  bool truth_published_ = false;
  ReportDetails details_;

  mutable std::mutex mutex_;
  std::deque<geometry_msgs::PoseStamped::ConstPtr> truth_;
  bool active_ = false, done_ = false;
  AlignmentReport result_;

  ros::Subscriber truth_sub_, mismatch_sub_;
  // one of them
  std::unique_ptr<Client<AlignPegAction>> align_;
  std::unique_ptr<Client<AssemblePegAction>> assemble_;
};

/// main() of the program: 2 for bad parameters, 1 without a master.
int runReport(int argc, char** argv);

}  // namespace assembly_cell::ros_bridge
