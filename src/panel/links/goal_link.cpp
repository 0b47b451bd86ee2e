// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "goal_link.h"

#include <actionlib_msgs/GoalID.h>
#include <geometry_msgs/PoseStamped.h>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/supervision/peg_state.h"

namespace assembly_cell::panel {

namespace {

constexpr std::size_t kMaxLine = 300;  // characters of a text

Pair pairOf(const boost::array<double, 2>& values) { return {values[0], values[1]}; }

GoalView::Outcome outcomeOf(std::uint8_t status) {
  if (status == actionlib_msgs::GoalStatus::SUCCEEDED) return GoalView::Outcome::kSuccess;
  const bool cancelled = status == actionlib_msgs::GoalStatus::PREEMPTED ||
                         status == actionlib_msgs::GoalStatus::RECALLED;
  return cancelled ? GoalView::Outcome::kCancelled : GoalView::Outcome::kFailure;
}

}  // namespace

GoalLink::GoalLink(const ros::NodeHandle& nh) : topics_{nh, mutex_} {
  subscribeResult<AlignPegActionResult>("align");
  subscribeResult<AssemblePegActionResult>("assemble");
  subscribeResult<RetreatActionResult>("retreat");
  subscribeResult<MoveToContactActionResult>("move_to_contact");
  subs_.push_back(topics_.subscribeChecked<AlignPegActionFeedback>(
      "align/feedback",
      [this](const AlignPegActionFeedback& message) { updateProgress(message.feedback); }));
  subs_.push_back(topics_.subscribeChecked<AssemblePegActionFeedback>(
      "assemble/feedback", [this](const AssemblePegActionFeedback& message) {
        updateProgress(message.feedback);
        goal_.inserting = message.feedback.depth > 0.0;
        goal_.depth = message.feedback.depth;
        goal_.force = message.feedback.force;
        goal_.walls = message.feedback.walls;
      }));
  subs_.push_back(topics_.subscribeChecked<SupervisorState>(
      "assembly_supervisor/state", [this](const SupervisorState& state) { updateState(state); }));
  subs_.push_back(topics_.subscribeChecked<AlignmentReport>(
      "report", [this](const AlignmentReport& report) { updateEstimate(report); }));
  using Truth = geometry_msgs::PoseStamped;
  truth_sub_ = topics_.subscribeChecked<Truth>("truth/pose", [this](const Truth& message) {
    const Pose X_HP = ros_bridge::fromPose(message.pose, "truth/pose");
    const Eigen::Vector2d tilt = tiltOf(X_HP);
    truth_.add({message.header.stamp.toSec(), {-X_HP.p.x(), -X_HP.p.y()}, {tilt.x(), tilt.y()}});
  });
  align_pub_ = topics_.nh.advertise<AlignPegActionGoal>("align/goal", 1);
  assemble_pub_ = topics_.nh.advertise<AssemblePegActionGoal>("assemble/goal", 1);
  retreat_pub_ = topics_.nh.advertise<RetreatActionGoal>("retreat/goal", 1);
  for (const char* action : {"align", "assemble", "retreat", "move_to_contact"}) {
    cancel_pubs_.push_back(
        topics_.nh.advertise<actionlib_msgs::GoalID>(std::string(action) + "/cancel", 1));
  }
}

void GoalLink::start(const GoalRequest& request) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    estimate_ = EstimateView();
  }
  if (!request.insert) {
    AlignPegActionGoal goal;
    goal.goal.strategy = request.strategy;
    send(align_pub_, goal);
    return;
  }
  AssemblePegActionGoal goal;
  goal.goal.strategy = request.strategy;
  goal.goal.floor = request.floor;
  goal.goal.depth = request.floor ? 0.0 : request.depth;
  send(assemble_pub_, goal);
}

void GoalLink::cancel() {
  // no id, no time: all goals
  for (const ros::Publisher& pub : cancel_pubs_) pub.publish(actionlib_msgs::GoalID());
}

void GoalLink::retreat() { send(retreat_pub_, RetreatActionGoal()); }

template <class Goal>
void GoalLink::send(const ros::Publisher& pub, Goal goal) {
  goal.header.stamp = goal.goal_id.stamp = ros::Time::now();
  goal.goal_id.id = ros::this_node::getName() + "-" + std::to_string(ros::WallTime::now().toNSec());
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    resetGoal();
    goal_.requested = true;
    sent_id_ = goal.goal_id.id;
  }
  pub.publish(goal);
}

void GoalLink::show(CellView& view) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    view.goal = goal_;
    view.estimate = estimate_;
  }
  view.estimate.truth_there = truth_sub_.getNumPublishers() > 0;
  view.goal.there = align_pub_.getNumSubscribers() > 0;
  if (!view.goal.there) view.goal.goal.clear();
}

template <class Result>
void GoalLink::subscribeResult(const std::string& action) {
  subs_.push_back(topics_.subscribe<Result>(action + "/result", [this](const Result& message) {
    // not the result of a goal that was replaced by another one
    if (goal_.requested && message.status.goal_id.id != sent_id_) return;
    goal_.requested = false;
    goal_.outcome = outcomeOf(message.status.status);
    goal_.outcome_text = printable(message.status.text, kMaxLine);
  }));
}

template <class Feedback>
void GoalLink::updateProgress(const Feedback& feedback) {
  goal_.requested = false;
  goal_.step = printable(feedback.state);
  goal_.message = printable(feedback.message, kMaxLine);
  goal_.contacts = feedback.contacts;
  goal_.time = feedback.time;
  goal_.position_sd = feedback.position_sd;
  goal_.rotation_sd = feedback.rotation_sd;
}

void GoalLink::updateState(const SupervisorState& state) {
  if (!state.goal.empty() && state.goal != goal_.goal) {
    resetGoal();
    if (state.goal == "align" || state.goal == "assemble") estimate_ = EstimateView();
  }
  goal_.goal = state.goal;
  goal_.in_contact = state.in_contact;
  goal_.known = ros_bridge::isKnown(state);
  goal_.stuck = state.stuck;
  goal_.reason = printable(state.reason, kMaxLine);
}

void GoalLink::resetGoal() {
  GoalView next;
  next.goal = goal_.goal;
  next.in_contact = goal_.in_contact;
  next.known = goal_.known;
  next.stuck = goal_.stuck;
  next.reason = goal_.reason;
  goal_ = next;
}

void GoalLink::updateEstimate(const AlignmentReport& report) {
  EstimateView estimate;
  goal_.contacts = report.contacts;
  estimate.known = report.estimate_known;
  estimate.offset = pairOf(report.estimated_offset);
  estimate.tilt = pairOf(report.estimated_tilt);
  estimate.position_sd = goal_.position_sd;
  estimate.rotation_sd = goal_.rotation_sd;
  if (!report.reference.isZero()) {
    if (const auto peg = truth_.at(report.reference.toSec())) {
      estimate.truth_known = true;
      estimate.true_offset = peg->offset;
      estimate.true_tilt = peg->tilt;
    }
  }
  estimate_ = estimate;
}

}  // namespace assembly_cell::panel
