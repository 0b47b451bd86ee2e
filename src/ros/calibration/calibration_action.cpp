// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_action.h"

#include <assembly_cell/ApplyLoad.h>

#include <algorithm>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kPollPeriod = 0.05;   // between two checks for a cancel [s]
constexpr int kAttempts = 3;           // at a step whose window doesn't settle
constexpr double kReplyTimeout = 0.5;  // of a node that is checked, wall clock [s]

// Publishers of the strain, and of the bridges that feed the drivers, that are gone or mute.
std::string missingPublishers(const ros::NodeHandle& nh) {
  std::vector<std::string> topics;
  for (const char* topic :
       {"sensor_a/strain", "sensor_b/strain", "sensor_a/bridge", "sensor_b/bridge"}) {
    topics.push_back(nh.resolveName(topic));
  }
  std::vector<TopicPublisher> found = publishersOf(topics, kReplyTimeout);
  const auto present = [](const TopicPublisher& publisher) {
    return publisher.presence == NodePresence::kListening ||
           publisher.presence == NodePresence::kUnknown;
  };
  found.erase(std::remove_if(found.begin(), found.end(), present), found.end());
  return found.empty() ? "" : " (" + describe(found) + ")";
}

}  // namespace

CalibrationAction::CalibrationAction(const ros::NodeHandle& nh, CalibrationOperations& operations)
    : nh_(nh),
      operations_(operations),
      server_(nh_, "calibrate",
              [this](const CalibrateSensorsGoalConstPtr& goal) { execute(goal); }) {}

void CalibrationAction::shutdown() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  server_.shutdown();
}

std::string CalibrationAction::stopReason() const {
  if (stopping_) return "the server shuts down";
  return operations_.inAction() && server_.isPreemptRequested() ? "cancelled" : "";
}

bool CalibrationAction::cancelled() const {
  return server_.isPreemptRequested() || !ros::ok() || stopping_;
}

void CalibrationAction::publishFeedback(const std::string& state, const std::string& message) {
  CalibrateSensorsFeedback feedback;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    feedback_.state = state;
    feedback_.message = message;
    feedback_.observations = operations_.observationCount();
    feedback = feedback_;
  }
  server_.publishFeedback(feedback);
}

CalibrationRefusal CalibrationAction::stepByRig(const LoadRequest& step) {
  using Failure = CalibrationFailure;
  CalibrationRefusal refusal;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    publishFeedback("loading", describe(step));
    ApplyLoad call;
    call.request.step = toMessage(step);
    const std::string name = nh_.resolveName(operations_.settings().rig);
    if (!ros::service::waitForService(name, ros::Duration(operations_.settings().source_timeout)) ||
        !callService(name, call)) {
      throw InputError("service " + name + " doesn't answer: start the rig, or set ~rig empty");
    }
    if (!call.response.success) return {Failure::kRigRefused, call.response.message};
    publishFeedback("averaging", step.target.id);
    Observation o = fromMessage(call.response.test, "rig");
    o.id = step.target.id;
    refusal =
        operations_.read(o, {o.concerns(Side::kA), o.concerns(Side::kB)}, call.response.since);
    if (!refusal) return {};
    // a silent source ends the plan, a load that's too high only the step
    if (refusal.code == Failure::kSilent && !cancelled())
      throw InputError(refusal.text + missingPublishers(nh_));
    const bool again = refusal.code == Failure::kUnsettled || refusal.code == Failure::kApart ||
                       refusal.code == Failure::kRestarted;
    if (!again || cancelled()) break;
  }
  return refusal;
}

CalibrationRefusal CalibrationAction::stepByPerson(const LoadRequest& step) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    awaited_ = step.target;
    waiting_ = Waiting::kOpen;
  }
  publishFeedback("waiting for confirmation", describe(step) + "; then call confirm");
  std::unique_lock<std::mutex> lock(mutex_);
  while (waiting_ == Waiting::kReading || (waiting_ == Waiting::kOpen && !cancelled())) {
    changed_.wait_for(lock, std::chrono::duration<double>(kPollPeriod));
  }
  const bool done = waiting_ == Waiting::kDone;
  waiting_ = Waiting::kNo;
  if (done) return {};
  return {CalibrationFailure::kCancelled, "cancelled"};
}

void CalibrationAction::setWaiting(Waiting waiting) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_ = waiting;
  }
  changed_.notify_all();
}

void CalibrationAction::confirm(const ConfirmLoad::Request& request,
                                ConfirmLoad::Response& response) {
  Observation o;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (waiting_ != Waiting::kOpen) {
      throw InputError(waiting_ == Waiting::kReading ? "another confirmation is being read"
                                                     : "no action waits for a load");
    }
    waiting_ = Waiting::kReading;
    o = awaited_;
  }
  // the action, which has the lock on the observations, waits meanwhile
  try {
    if (request.changed) {
      const std::string id = o.id;
      o = fromMessage(request.test, "test");
      o.id = id;
    }
    const CalibrationRefusal refusal =
        operations_.read(o, {o.concerns(Side::kA), o.concerns(Side::kB)}, ros::Time());
    if (refusal) throw CalibrationError(refusal.code, refusal.text);
  } catch (...) {
    setWaiting(Waiting::kOpen);
    throw;
  }
  response.observations = operations_.observationCount();
  response.success = true;
  response.message =
      "observation " + std::to_string(response.observations) + " (" + o.id + ") is on disk";
  setWaiting(Waiting::kDone);
}

std::vector<LoadRequest> CalibrationAction::openPlan(const CalibrateSensorsGoal& goal,
                                                     std::set<std::string>& done) {
  const std::string plan = goal.plan.empty() ? operations_.settings().plan : goal.plan;
  const std::uint32_t seed = goal.seed == 0 ? 1 : goal.seed;
  if (plan.rfind("thesis", 0) == 0) {
    throw InputError("plan '" + plan +
                     "' is for comparison: call service plan to see what it lacks");
  }
  std::vector<LoadRequest> steps = operations_.steps(plan, seed);
  if (goal.restart) operations_.clear();
  std::set<std::string> ids;
  const ObservationSet kept = operations_.session().observations();
  for (const Observation& o : kept.observations) ids.insert(o.id);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    std::string& id = steps[i].target.id;
    id = plan + "/" + std::to_string(seed) + "/" + std::to_string(i + 1);
    if (ids.count(id) > 0) done.insert(id);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  feedback_ = CalibrateSensorsFeedback();
  feedback_.steps = static_cast<std::uint32_t>(steps.size());
  feedback_.step = static_cast<std::uint32_t>(done.size());
  return steps;
}

CalibrateSensorsResult CalibrationAction::runPlan(const CalibrateSensorsGoal& goal) {
  CalibrateSensorsResult result;
  std::set<std::string> done;
  const std::vector<LoadRequest> steps = openPlan(goal, done);
  result.resumed = static_cast<std::uint32_t>(done.size());
  if (result.resumed > 0) {
    ROS_INFO("calibrate: goes on after %u of %zu steps", result.resumed, steps.size());
  }
  std::size_t dropped = 0;
  const auto run = [&](const LoadRequest& step) {
    const CalibrationRefusal refusal =
        operations_.settings().rig.empty() ? stepByPerson(step) : stepByRig(step);
    if (cancelled()) return false;
    if (!refusal) return true;
    const std::string text = step.target.id + ": " + refusal.text;
    ROS_WARN("calibrate: step dropped: %s", text.c_str());
    if (static_cast<double>(++dropped) >
        operations_.settings().max_dropped * static_cast<double>(steps.size())) {
      throw InputError(std::to_string(dropped) + " steps dropped, the last one " + text);
    }
    return true;
  };
  // the zero may have moved since the last run
  const auto zero = std::find_if(steps.begin(), steps.end(), [](const LoadRequest& step) {
    return step.target.kind == ObservationKind::kUnloaded;
  });
  if (!done.empty() && done.size() < steps.size() && zero != steps.end()) {
    LoadRequest again = *zero;
    const std::string& first = steps.front().target.id;
    again.target.id = first.substr(0, first.rfind('/') + 1) + "zero/" +
                      std::to_string(operations_.observationCount() + 1);
    if (!run(again)) return result;
  }
  for (const LoadRequest& step : steps) {
    if (done.count(step.target.id) > 0) continue;
    if (cancelled() || !run(step)) return result;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++feedback_.step;
    }
    publishFeedback("averaging", step.target.id + " done");
  }

  publishFeedback("solving", std::to_string(operations_.observationCount()) + " observations");
  result.result = operations_.solve(ForceSettings());
  result.success = result.result.accepted;
  result.message = result.result.message;
  if (result.success && !goal.dry_run && !cancelled()) {
    publishFeedback("saving", goal.id);
    const CalibrationOperations::Stored stored = operations_.save(goal.id);
    result.id = stored.id;
    result.message = stored.message + "; " + result.message;
  }
  return result;
}

void CalibrationAction::execute(const CalibrateSensorsGoalConstPtr& goal) {
  CalibrateSensorsResult result;
  const std::unique_lock<std::mutex> busy = operations_.tryAcquire();
  if (!busy) {
    result.message = "another request is under way: try again";
    server_.end(actionlib_msgs::GoalStatus::ABORTED, result, result.message);
    return;
  }
  operations_.setInAction(true);
  bool failed = false;
  try {
    result = runPlan(*goal);
  } catch (const InputError& error) {
    failed = true;
    result.message = error.what();
  }
  operations_.setInAction(false);
  result.observations = operations_.observationCount();
  if (cancelled() && !result.success) {
    result.message = "cancelled; " + std::to_string(result.observations) +
                     " observations are on disk: the same goal goes on from here";
    server_.end(actionlib_msgs::GoalStatus::PREEMPTED, result, result.message);
  } else if (failed || !result.success) {
    result.success = false;
    server_.end(actionlib_msgs::GoalStatus::ABORTED, result, result.message);
  } else {
    server_.end(actionlib_msgs::GoalStatus::SUCCEEDED, result, result.message);
  }
}

}  // namespace assembly_cell::ros_bridge
