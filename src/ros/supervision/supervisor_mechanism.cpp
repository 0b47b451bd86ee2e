// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>

#include "assembly_cell/IdentifyAction.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/mechanism_check.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/supervision/supervisor_node.h"

// What the supervisor knows of the mechanism: checked on the hanging peg before each alignment,
// identified anew where that is allowed.
namespace assembly_cell::ros_bridge {

namespace {

constexpr double kLook = 0.02;     // between two looks at the action, wall clock [s]
constexpr double kServer = 10.0;   // for its server, wall clock [s]
constexpr double kCancelTimeout = 10.0;  // for the answer to a cancel, wall clock [s]
constexpr double kQuestion = 1.0;  // between two looks for the node, wall clock [s]
constexpr double kReplyTimeout = 2.0;    // of the node to a question, wall clock [s]

// the others go by places of touches or wrenches
bool needsMechanism(const std::string& strategy) {
  return strategy == "single_contact" || strategy == "double_contact" || strategy == "vibratory";
}

// false: not within `limit` of wall time, or cancelled
template <class Condition>
bool lookFor(double limit, const std::function<bool()>& cancelled, const Condition& condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(limit);
  while (!condition()) {
    if (!ros::ok() || cancelled() || ros::WallTime::now() > end) return false;
    ros::WallDuration(kLook).sleep();
  }
  return true;
}

}  // namespace

void SupervisorNode::readMechanism(Parameters& parameters) {
  const std::string file = parameters.text("mechanism", "");
  identify_ = parameters.flag("identify", false);
  identify_time_ = parameters.number("identify_time", Range{5.0, 60.0}, identify_time_);
  if (file.empty()) return;
  known_ = loadKnownMechanism(file);
  if (!known_->accepted) {
    throw InputError("~mechanism: value " + file + ": its identification says " + known_->verdict +
                     "; identify the mechanism anew");
  }
  mechanism_ = known_->mechanism;
}

std::string SupervisorNode::contradiction() {
  plant_->know(nullptr);
  // a peg in the hole doesn't hang
  if (!known_ || !known_->identified || inserted() > 0.0) return "";
  const MechanismCheck check = checkMechanism(*plant_, *known_);
  return check.agrees ? "" : check.message;
}

void SupervisorNode::goBy(KnownMechanism known) {
  known_ = std::move(known);
  mechanism_ = known_->mechanism;
  X_CP_.p.z() = -mechanism_.peg.coupling_height - mechanism_.peg.half_height;
}

void SupervisorNode::goByNews() {
  std::optional<KnownMechanism> news;
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    news.swap(news_);
  }
  if (news) goBy(std::move(*news));
}

const KnownMechanism* SupervisorNode::beginKnown(
    const std::string& strategy, const std::function<bool()>& cancelled,
    const std::function<void(const AlignProgress&)>& progress) {
  goByNews();
  const auto report = [&](const std::string& why) {
    AlignProgress now;
    now.state = "identify";
    now.message = why;
    progress(now);
  };
  const bool known = known_ && known_->identified;
  if (identify_ && !known && needsMechanism(strategy)) {
    report("no mechanism on file");
    identifyMechanism(cancelled);
  }
  plant_->begin(cancelled);
  std::string wrong = contradiction();
  if (identify_ && !wrong.empty()) {
    report(wrong);
    plant_->end(false);
    identifyMechanism(cancelled);
    plant_->begin(cancelled);
    wrong = contradiction();
  }
  if (!wrong.empty()) throw AlignError(AlignFailure::kWrongMechanism, wrong);
  return known_ && known_->identified ? &*known_ : nullptr;
}

void SupervisorNode::identifyMechanism(const std::function<bool()>& cancelled) {
  using Client = actionlib::SimpleActionClient<IdentifyAction>;
  Client client(nh_, "identify", false);
  const auto ended = [&] { return cancelled() || plant_->stopping(); };
  const auto giveUp = [&] {
    if (plant_->stopping()) {
      throw PlantError(AlignFailure::kStopped, "the node is shutting down");
    }
    if (cancelled()) throw PlantError(AlignFailure::kCancelled, "cancelled");
  };
  if (!lookFor(kServer, ended, [&] { return client.isServerConnected(); })) {
    giveUp();
    throw PlantError(AlignFailure::kNoData,
                     text("no action server identify within %g s of wall time: is "
                          "mechanism_identifier running?",
                          kServer));
  }
  IdentifyGoal goal;
  goal.time_limit = identify_time_;
  client.sendGoal(goal);
  const auto done = [&] { return client.getState().isDone(); };
  // it ends by itself, where the cell stops, with the reason; not when its process dies or freezes
  while (!lookFor(kQuestion, ended, done) && !ended()) {
    const auto found = publishersOf({nh_.resolveName("identify/status")}, kReplyTimeout * slow_factor_);
    if (found.front().presence != NodePresence::kListening && !done()) {
      throw PlantError(AlignFailure::kNoData, "no result of identify: " + describe(found));
    }
  }
  if (!done()) {
    client.cancelGoal();
    lookFor(
        kCancelTimeout, [] { return false; }, done);
    giveUp();
  }
  const IdentifyResultConstPtr result = client.getResult();
  if (!result || !result->accepted || result->file.empty()) {
    const std::string why = !result            ? client.getState().toString()
                            : result->accepted ? result->message
                                               : result->verdict;
    throw PlantError(AlignFailure::kNoReading, "identify of mechanism_identifier: " + why);
  }
  goBy(loadKnownMechanism(result->file));
}

}  // namespace assembly_cell::ros_bridge
