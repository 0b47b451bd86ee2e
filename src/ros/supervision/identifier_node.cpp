// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/identifier_node.h"

#include <std_msgs/String.h>

#include <cmath>
#include <filesystem>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/date.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/fit.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/supervision/mechanism_news.h"
#include "assembly_cell/ros/supervision/watched_plant.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kFreeing = 5.0;                      // of cell time after a goal that failed [s]
constexpr double kLeastTime = 5.0, kMostTime = 60.0;  // of a goal's time_limit [s]

void tell(const Mechanism& nominal, const Identification& found, IdentifyResult& result) {
  result.accepted = found.accepted;
  result.verdict = found.verdict;
  result.chi2 = found.chi2;
  result.dof = static_cast<std::uint32_t>(found.dof);
  result.p = found.p;
  result.notes = found.notes;
  for (int i = 0; i < kUnknowns; ++i) {
    result.parameters.push_back(found.unknowns[static_cast<std::size_t>(i)].name);
    result.values.push_back(valueAt(nominal, found.unknowns, i, found.z[i]));
    result.sds.push_back(sdAt(nominal, found.unknowns, i, found.z[i], found.sd(i)));
  }
  for (const int i : found.unseen) {
    result.unseen.push_back(found.unknowns[static_cast<std::size_t>(i)].name);
  }
}

}  // namespace

IdentifierNode::IdentifierNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  scenario_ = parameters.text("scenario");
  mechanism_ = loadMechanism(scenario_, parameters.texts("overrides", std::vector<std::string>{}));
  file_ = parameters.text("file", "");
  prior_scale_ = parameters.number("prior_scale", Range{0.1, 10.0}, prior_scale_);
  limits_.force = parameters.number("force_limit", Range{1.0, 1000.0}, limits_.force);
  const RosPlant::Settings settings = plantSettings(parameters, pnh.getNamespace());
  parameters.refuseUnknown();
  plant_ = std::make_unique<RosPlant>(nh, settings);
  state_pub_ = pnh.advertise<SupervisorState>("state", 10, true);
  mechanism_pub_ = nh.advertise<std_msgs::String>(kMechanismTopic, 1, true);
  tellPeg("", false, "");
  supervisor_sub_ = subscribeChecked<SupervisorState>(
      nh, "assembly_supervisor/state", 10,
      [this](const SupervisorState::ConstPtr& message) { hearSupervisor(*message); });
  server_ = std::make_unique<Server>(nh, "identify",
                                     [this](const IdentifyGoalConstPtr& goal) { execute(goal); });
  server_->start();
}

IdentifierNode::~IdentifierNode() {
  plant_->stop();
  server_->shutdown();
}

void IdentifierNode::stop() {
  plant_->stop();
  // a goal under way ends, frees the peg and answers
  const std::lock_guard<std::mutex> turn(busy_);
}

void IdentifierNode::identifyInto(const IdentifyGoal& goal, IdentifyResult& result) {
  IdentificationPlan plan = planFor(mechanism_);
  plan.force_limit = limits_.force;
  if (goal.time_limit != 0.0) plan.time_limit = goal.time_limit;
  if (!(plan.time_limit >= kLeastTime && plan.time_limit <= kMostTime)) {
    throw InputError(text("time_limit is %g s: give %g to %g s, or 0 for the most", goal.time_limit,
                          kLeastTime, kMostTime));
  }
  const std::string file = goal.file.empty() ? file_ : goal.file;
  if (!file.empty()) checkWritable(file, "file '" + printable(file, 200) + "'");
  const auto progress = [this](const IdentificationProgress& now) {
    IdentifyFeedback feedback;
    feedback.state = now.state;
    feedback.time = now.time;
    feedback.readings = static_cast<std::uint32_t>(now.readings);
    server_->publishFeedback(feedback);
  };
  plant_->begin([this] { return server_->isPreemptRequested(); });
  const IdentificationData data = measure(*plant_, mechanism_, plan, progress);
  result.time = data.time;
  result.readings = static_cast<std::uint32_t>(data.vibrations.size());
  // the peg hangs where it did, and nothing is asked of the plant any more
  plant_->end(false);
  tellPeg("identify", false, "");
  progress({"fit", data.time, static_cast<int>(data.vibrations.size() + data.poses.size())});
  IdentificationPrior prior;
  prior.unknowns = unknownsAsDrawn(prior_scale_);
  const Identification found = identify(mechanism_, data, prior);
  tell(mechanism_, found, result);
  std_msgs::String record;
  record.data = mechanismRecord(mechanism_, found, "mechanism_identifier, " + scenario_, utcNow());
  if (!file.empty()) {
    writeFileAtomically(file, record.data, file);
    result.file = std::filesystem::absolute(file).string();
  }
  if (found.accepted) mechanism_pub_.publish(record);
  result.message = file.empty() ? "not stored: no file was named" : "stored in " + result.file;
}

// What a goal of the supervisor has left, for a goal of our own that moves nothing.
void IdentifierNode::hearSupervisor(const SupervisorState& supervisor) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  if (!supervisor.goal.empty() || !state_.goal.empty()) return;
  state_.in_contact = supervisor.in_contact;
  state_.reason = supervisor.reason;
}

SupervisorState IdentifierNode::peg() {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  return state_;
}

void IdentifierNode::tellPeg(const std::string& goal, bool in_contact, const std::string& reason) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  state_.header.stamp = plant_->stamp();
  state_.goal = goal;
  state_.in_contact = in_contact;
  state_.reason = reason;
  SupervisorState told = state_;
  if (!goal.empty()) told.reason.clear();  // it's that of the goal before
  state_pub_.publish(told);
}

bool IdentifierNode::free(bool hung_free) {
  bool pressed = plant_->hasMoved();
  try {
    if (pressed && plant_->hasData()) {
      plant_->recover(kFreeing);
      GuardedCarrier carrier(*plant_, limits_);
      releasePeg(carrier, mechanism_,
                 hung_free ? std::optional(plant_->startPose()) : std::nullopt);
      pressed = false;
    }
  } catch (const std::exception& error) {
    ROS_WARN("the peg could not be freed: %s", error.what());
  }
  plant_->end(pressed);
  return !pressed;
}

void IdentifierNode::execute(const IdentifyGoalConstPtr& goal) {
  IdentifyResult result;
  bool failed = false;
  const std::lock_guard<std::mutex> turn(busy_);
  const SupervisorState before = peg();
  tellPeg("identify", before.in_contact, before.reason);
  try {
    identifyInto(*goal, result);
    tellPeg("", false, "");
  } catch (const std::exception& error) {
    failed = true;
    result.accepted = false;
    result.message = error.what();
    if (result.verdict.empty()) result.verdict = "refused: " + result.message;
    const bool moved = plant_->hasMoved();
    const bool freed = free(!before.in_contact);
    // what has moved nothing leaves the peg as it was
    const SupervisorState left = peg();
    if (moved) tellPeg("", !freed, freed ? "" : result.message);
    if (!moved) tellPeg("", left.in_contact, left.reason);
  }
  server_->finish(result.accepted, result, failed ? result.message : result.verdict);
}

}  // namespace assembly_cell::ros_bridge
