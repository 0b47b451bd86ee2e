// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The action of calibration_server: a whole plan, step by step.
#include <assembly_cell/ApplyLoad.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/ros/calibration/calibration_server_node.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kSlice = 0.05;  // of waiting, after which a cancel is looked at [s]
constexpr int kTries = 3;        // of a step whose window doesn't settle
constexpr double kAnswer = 0.5;  // of a node to a question, wall clock [s]

// A driver that has nothing to say is silent, too: who feeds it?
std::string whoIsGone(const ros::NodeHandle& nh) {
  std::vector<std::string> topics;
  for (const char* topic :
       {"sensor_a/strain", "sensor_b/strain", "sensor_a/bridge", "sensor_b/bridge"}) {
    topics.push_back(nh.resolveName(topic));
  }
  std::vector<TopicPublisher> found = publishersOf(topics, kAnswer);
  const auto there = [](const TopicPublisher& publisher) {
    return publisher.presence != NodePresence::kGone && publisher.presence != NodePresence::kMute;
  };
  found.erase(std::remove_if(found.begin(), found.end(), there), found.end());
  return found.empty() ? "" : " (" + describe(found) + ")";
}

}  // namespace

bool CalibrationServerNode::cancelled() {
  return action_->isPreemptRequested() || !ros::ok() || stopping_;
}

void CalibrationServerNode::tell(const std::string& state, const std::string& message) {
  CalibrateSensorsFeedback feedback;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    feedback_.state = state;
    feedback_.message = message;
    feedback_.observations = observationCount();
    feedback = feedback_;
  }
  action_->publishFeedback(feedback);
}

CalibrationRefusal CalibrationServerNode::stepByRig(const LoadRequest& step) {
  using Failure = CalibrationFailure;
  CalibrationRefusal refusal;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    tell("loading", describe(step));
    ApplyLoad call;
    call.request.step = toMessage(step);
    const std::string name = nh_.resolveName(rig_);
    if (!ros::service::waitForService(name, ros::Duration(source_timeout_.count())) ||
        !callService(name, call)) {
      throw InputError("service " + name + " doesn't answer: start the rig, or set ~rig empty");
    }
    if (!call.response.success) return {Failure::kRigRefused, call.response.message};
    tell("averaging", step.target.id);
    Observation o = fromMessage(call.response.test, "rig");
    o.id = step.target.id;
    refusal = windows_->read(o, {o.concerns(Side::kA), o.concerns(Side::kB)}, call.response.since);
    if (!refusal) {
      keep(o);
      return {};
    }
    // a silent source ends the plan, a load that's too high only the step
    if (refusal.code == Failure::kSilent && !cancelled())
      throw InputError(refusal.text + whoIsGone(nh_));
    const bool again = refusal.code == Failure::kUnsettled || refusal.code == Failure::kApart ||
                       refusal.code == Failure::kRestarted;
    if (!again || cancelled()) break;
  }
  return refusal;
}

CalibrationRefusal CalibrationServerNode::stepByPerson(const LoadRequest& step) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    awaited_ = step.target;
    waiting_ = Waiting::kOpen;
  }
  tell("waiting for confirmation", describe(step) + "; then call confirm");
  std::unique_lock<std::mutex> lock(mutex_);
  while (waiting_ == Waiting::kReading || (waiting_ == Waiting::kOpen && !cancelled())) {
    changed_.wait_for(lock, Seconds(kSlice));
  }
  const bool done = waiting_ == Waiting::kDone;
  waiting_ = Waiting::kNo;
  if (done) return {};
  return {CalibrationFailure::kCancelled, "cancelled"};
}

bool CalibrationServerNode::confirm(ConfirmLoad::Request& request,
                                    ConfirmLoad::Response& response) {
  return answer(response, "confirm", [&] {
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
    // the action waits meanwhile, so that this thread may change the observations
    const auto finish = [&](Waiting next) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        waiting_ = next;
      }
      changed_.notify_all();
    };
    try {
      if (request.changed) {
        const std::string id = o.id;
        o = fromMessage(request.test, "test");
        o.id = id;
      }
      read(o, {o.concerns(Side::kA), o.concerns(Side::kB)});
    } catch (...) {
      finish(Waiting::kOpen);
      throw;
    }
    response.observations = observationCount();
    response.success = true;
    response.message =
        "observation " + std::to_string(response.observations) + " (" + o.id + ") is on disk";
    finish(Waiting::kDone);
  });
}

// the plan's steps, and how many of them an interrupted run has left
std::vector<LoadRequest> CalibrationServerNode::openPlan(const CalibrateSensorsGoal& goal,
                                                         std::set<std::string>& there) {
  const std::string plan = goal.plan.empty() ? default_plan_ : goal.plan;
  const std::uint32_t seed = goal.seed == 0 ? 1 : goal.seed;
  if (plan.rfind("thesis", 0) == 0) {
    throw InputError("plan '" + plan + "' is for comparison: ask service plan what it lacks");
  }
  std::vector<LoadRequest> steps = makeSteps(plan, seed);
  if (goal.restart) startAnew();
  std::set<std::string> ids;
  for (const Observation& o : session_->observations().observations) ids.insert(o.id);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    std::string& id = steps[i].target.id;
    id = plan + "/" + std::to_string(seed) + "/" + std::to_string(i + 1);
    if (ids.count(id) > 0) there.insert(id);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  feedback_ = CalibrateSensorsFeedback();
  feedback_.steps = static_cast<std::uint32_t>(steps.size());
  feedback_.step = static_cast<std::uint32_t>(there.size());
  return steps;
}

CalibrateSensorsResult CalibrationServerNode::runPlan(const CalibrateSensorsGoal& goal) {
  CalibrateSensorsResult result;
  std::set<std::string> there;
  const std::vector<LoadRequest> steps = openPlan(goal, there);
  result.resumed = static_cast<std::uint32_t>(there.size());
  if (result.resumed > 0) {
    ROS_INFO("calibrate: goes on after %u of %zu steps", result.resumed, steps.size());
  }
  std::size_t dropped = 0;
  const auto run = [&](const LoadRequest& step) {
    const CalibrationRefusal refusal = rig_.empty() ? stepByPerson(step) : stepByRig(step);
    if (cancelled()) return false;
    if (!refusal) return true;
    const std::string text = step.target.id + ": " + refusal.text;
    ROS_WARN("calibrate: step dropped: %s", text.c_str());
    if (static_cast<double>(++dropped) > max_dropped_ * static_cast<double>(steps.size())) {
      throw InputError(std::to_string(dropped) + " steps dropped, the last one " + text);
    }
    return true;
  };
  // the zero may have moved since the last run
  const auto zero = std::find_if(steps.begin(), steps.end(), [](const LoadRequest& step) {
    return step.target.kind == ObservationKind::kUnloaded;
  });
  if (!there.empty() && there.size() < steps.size() && zero != steps.end()) {
    LoadRequest again = *zero;
    const std::string& first = steps.front().target.id;
    again.target.id =
        first.substr(0, first.rfind('/') + 1) + "zero/" + std::to_string(observationCount() + 1);
    if (!run(again)) return result;
  }
  for (const LoadRequest& step : steps) {
    if (there.count(step.target.id) > 0) continue;
    if (cancelled() || !run(step)) return result;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++feedback_.step;
    }
    tell("averaging", step.target.id + " done");
  }

  tell("solving", std::to_string(observationCount()) + " observations");
  result.result = solveAll(ForceSettings());
  result.success = result.result.accepted;
  result.message = result.result.message;
  if (result.success && !goal.dry_run && !cancelled()) {
    tell("saving", goal.id);
    const Stored stored = saveSolution(goal.id);
    result.id = stored.id;
    result.message = stored.message + "; " + result.message;
  }
  return result;
}

void CalibrationServerNode::calibrate(const CalibrateSensorsGoalConstPtr& goal) {
  CalibrateSensorsResult result;
  const std::unique_lock<std::mutex> busy(busy_, std::try_to_lock);
  if (!busy) {
    result.message = "another request is under way: try again";
    action_->end(actionlib_msgs::GoalStatus::ABORTED, result, result.message);
    return;
  }
  in_action_ = true;
  publishStatus();
  bool failed = false;
  try {
    result = runPlan(*goal);
  } catch (const InputError& error) {
    failed = true;
    result.message = error.what();
  }
  in_action_ = false;
  publishStatus();
  result.observations = observationCount();
  if (cancelled() && !result.success) {
    result.message = "cancelled; " + std::to_string(result.observations) +
                     " observations are on disk: the same goal goes on from here";
    action_->end(actionlib_msgs::GoalStatus::PREEMPTED, result, result.message);
  } else if (failed || !result.success) {
    result.success = false;
    action_->end(actionlib_msgs::GoalStatus::ABORTED, result, result.message);
  } else {
    action_->end(actionlib_msgs::GoalStatus::SUCCEEDED, result, result.message);
  }
}

std::uint32_t CalibrationServerNode::observationCount() const {
  return static_cast<std::uint32_t>(session_->observations().observations.size());
}

}  // namespace assembly_cell::ros_bridge
