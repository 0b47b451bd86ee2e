// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "calibration_link.h"

#include <actionlib_msgs/GoalID.h>
#include <std_srvs/Trigger.h>

#include <algorithm>

#include "assembly_cell/CalibrateSensorsAction.h"
#include "assembly_cell/CalibrationStatus.h"
#include "assembly_cell/ConfirmLoad.h"
#include "assembly_cell/GetCalibrations.h"
#include "assembly_cell/LoadCalibration.h"
#include "assembly_cell/PlanCalibration.h"
#include "assembly_cell/base/text.h"
#include "requests/service_request.h"

namespace assembly_cell::panel {

namespace {

constexpr std::size_t kMaxReport = 500;  // characters of a text

constexpr char kRunning[] = "calibrate";  // state of the server while its action runs
constexpr auto kFeedbackTimeout = std::chrono::seconds(2);

std::string serverName(const std::string& service) { return "calibration_server/" + service; }

}  // namespace

CalibrationLink::CalibrationLink(const ros::NodeHandle& nh, AsyncRequests& requests)
    : requests_(requests), topics_{nh, mutex_} {
  goal_pub_ = topics_.nh.advertise<CalibrateSensorsActionGoal>("calibrate/goal", 1);
  cancel_pub_ = topics_.nh.advertise<actionlib_msgs::GoalID>("calibrate/cancel", 1);
  status_sub_ = topics_.subscribe<CalibrationStatus>(
      serverName("status"), [this](const CalibrationStatus& status) {
        const bool running = status.state == kRunning;
        if (running && !view_.running) running_since_ = Clock::now();
        view_.running = running;
        view_.state = printable(status.state);
        view_.observations = status.observations;
        view_.last_id = printable(status.last_id);
        view_.active = {printable(status.calibration_a), printable(status.calibration_b)};
      });
  using Feedback = CalibrateSensorsActionFeedback;
  feedback_sub_ =
      topics_.subscribe<Feedback>("calibrate/feedback", [this](const Feedback& message) {
        view_.result_known = false;
        view_.step = message.feedback.step;
        view_.step_count = message.feedback.steps;
        view_.observations = message.feedback.observations;
        view_.step_state = printable(message.feedback.state);
        view_.step_message = printable(message.feedback.message, kMaxReport);
      });
  using Result = CalibrateSensorsActionResult;
  result_sub_ = topics_.subscribe<Result>("calibrate/result", [this](const Result& message) {
    const std::string& text = message.result.message;
    view_.result_known = true;
    view_.success = message.result.success;
    view_.result = printable(text.empty() ? message.status.text : text, kMaxReport);
    view_.step_state.clear();
    view_.step_message.clear();
  });
}

CalibrationView CalibrationLink::view() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  CalibrationView out = view_;
  out.there = status_sub_.getNumPublishers() > 0 && feedback_sub_.getNumPublishers() > 0 &&
              goal_pub_.getNumSubscribers() > 0;
  out.step_unknown =
      view_.running && view_.step_state.empty() && Clock::now() - running_since_ > kFeedbackTimeout;
  return out;
}

void CalibrationLink::requestPlan(const std::string& plan) {
  PlanCalibration::Request request;
  request.plan = plan;
  callServiceAsync<PlanCalibration>(
      requests_, "plan", topics_.nh.resolveName(serverName("plan")), request,
      [this, plan](const PlanCalibration::Response& response) {
        std::vector<CalibrationStep> steps;
        for (const LoadStep& step : response.steps) {
          steps.push_back({printable(step.text, kMaxReport), step.test.kind, step.test.mass});
        }
        const std::lock_guard<std::mutex> lock(mutex_);
        steps_ = response.steps;
        view_.steps = steps;
        view_.plan = plan;
        view_.plan_good = response.success;
        view_.plan_report = printable(response.message, kMaxReport);
      });
}

void CalibrationLink::start(const CalibrationRequest& request) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    view_.result_known = false;
  }
  CalibrateSensorsActionGoal goal;
  goal.goal.plan = request.plan;
  goal.goal.restart = request.restart;
  goal.goal.id = request.id;
  goal.header.stamp = goal.goal_id.stamp = ros::Time::now();
  goal.goal_id.id = ros::this_node::getName() + "-" + std::to_string(ros::WallTime::now().toNSec());
  goal_pub_.publish(goal);
}

void CalibrationLink::cancel() { cancel_pub_.publish(actionlib_msgs::GoalID()); }

int CalibrationLink::awaitedStep() const {
  const std::string& message = view_.step_message;
  const auto begins = [&message](const LoadStep& step) {
    const std::string text = printable(step.text, kMaxReport);
    return message.compare(0, text.size() + 1, text + ";") == 0;
  };
  // equal texts are equal loads
  const auto found = std::find_if(steps_.begin(), steps_.end(), begins);
  return found == steps_.end() ? -1 : static_cast<int>(found - steps_.begin());
}

void CalibrationLink::confirm(const Measured& measured) {
  ConfirmLoad::Request request;
  if (measured.changed) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const int step = awaitedStep();
    if (step >= 0) {
      request.changed = true;
      request.test = steps_[static_cast<std::size_t>(step)].test;
      request.test.mass = measured.mass;
      if (request.test.kind == "displacement") {
        request.test.gauges.assign(measured.gauges.begin(), measured.gauges.end());
      }
    }
  }
  callServiceAsync<ConfirmLoad>(requests_, "confirm", topics_.nh.resolveName(serverName("confirm")),
                                request);
}

void CalibrationLink::removeLast() {
  callServiceAsync<std_srvs::Trigger>(requests_, "remove last",
                                      topics_.nh.resolveName(serverName("remove_last")), {});
}

void CalibrationLink::requestStored() {
  callServiceAsync<GetCalibrations>(
      requests_, "stored", topics_.nh.resolveName(serverName("get_calibration")), {},
      [this](const GetCalibrations::Response& response) {
        std::vector<std::string> ids = response.stored_a;
        ids.insert(ids.end(), response.stored_b.begin(), response.stored_b.end());
        std::sort(ids.begin(), ids.end());
        ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
        const std::lock_guard<std::mutex> lock(mutex_);
        view_.stored = ids;
      });
}

void CalibrationLink::load(const std::string& id) {
  LoadCalibration::Request request;
  request.id = id;
  callServiceAsync<LoadCalibration>(requests_, "load", topics_.nh.resolveName(serverName("load")),
                                    request);
}

}  // namespace assembly_cell::panel
