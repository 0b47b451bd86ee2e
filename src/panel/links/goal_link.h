// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/SupervisorState.h"
#include "cell_view.h"
#include "ground_truth_trail.h"
#include "locked_subscriber.h"

namespace assembly_cell::panel {

/// Goals of the supervisor: sends them, follows their progress and results, compares the estimate
/// with the ground truth of a simulation.
class GoalLink {
 public:
  explicit GoalLink(const ros::NodeHandle& nh);

  void start(const GoalRequest& request);
  void cancel();  ///< all goals, of any client
  void retreat();
  /// Fills in goal and estimate.
  void show(CellView& view) const;

 private:
  template <class Goal>
  void send(const ros::Publisher& pub, Goal goal);
  template <class Result>
  void subscribeResult(const std::string& action);
  // with the mutex locked
  template <class Feedback>
  void updateProgress(const Feedback& feedback);
  void updateState(const SupervisorState& state);
  void resetGoal();  ///< of the previous goal only the state of the peg is kept
  void updateEstimate(const AlignmentReport& report);

  mutable std::mutex mutex_;
  LockedSubscriber topics_;
  GoalView goal_;
  EstimateView estimate_;
  GroundTruthTrail truth_;
  std::string sent_id_;  // of the last goal sent from here
  ros::Subscriber truth_sub_;
  std::vector<ros::Subscriber> subs_;
  ros::Publisher align_pub_, assemble_pub_, retreat_pub_;
  std::vector<ros::Publisher> cancel_pubs_;
};

}  // namespace assembly_cell::panel
