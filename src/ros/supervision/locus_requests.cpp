// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/locus_requests.h"

#include <utility>

#include "assembly_cell/base/text.h"
#include "assembly_cell/locus/vibration_fit.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/estimation/locus_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

// Recent blocks in which a window may begin: their least number, and beyond it their age [s].
constexpr std::size_t kRecent = 25;
constexpr double kRecentTime = 0.499;
constexpr std::size_t kMinSamples = 8;  // of a window

}  // namespace

// ---- the action ----

LocusRequests::LocusRequests(ros::NodeHandle& nh, std::function<void()> changed)
    : changed_(std::move(changed)), client_(nh, "identify_locus", false) {
  using Status = actionlib_msgs::GoalStatusArray;
  const boost::function<void(const ros::MessageEvent<Status const>&)> on_status =
      [this](const auto& event) {
        const std::lock_guard<std::mutex> lock(mutex_);
        server_ = event.getPublisherName();
      };
  status_sub_ = nh.subscribe<Status, const ros::MessageEvent<Status const>&>(
      "identify_locus/status", 1, on_status);
}

std::string LocusRequests::server() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return server_;
}

bool LocusRequests::isPending() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return pending_;
}

LocusRequest LocusRequests::window() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return window_;
}

bool LocusRequests::isAccepted() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return accepted_ || done_;
}

bool LocusRequests::isDone() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return done_;
}

void LocusRequests::send(const IdentifyLocusGoal& goal, const LocusRequest& window) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    window_ = window;
    pending_ = true;
    accepted_ = done_ = false;
    outcome_ = {};
  }
  client_.sendGoal(
      goal,
      [this](const actionlib::SimpleClientGoalState& state,
             const IdentifyLocusResult::ConstPtr& result) { onDone(state, result); },
      [this] {
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          accepted_ = true;
        }
        changed_();
      });
}

void LocusRequests::onDone(const actionlib::SimpleClientGoalState& state,
                           const IdentifyLocusResult::ConstPtr& result) {
  Outcome outcome;
  const std::string fault = result ? check(result->locus).text() : std::string();
  if (!fault.empty()) {
    outcome.error = "locus: " + fault;
  } else if (!result || (!result->success && result->locus.samples == 0)) {
    outcome.error =
        result && !result->message.empty() ? result->message : "ended as " + state.toString();
  } else {
    // one that is refused for its noise is a measurement, too
    outcome.reading = fromLocusEstimate(result->locus);
    if (!result->success) outcome.reading->refusal = result->message;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    outcome_ = outcome;
    done_ = true;
  }
  changed_();
}

void LocusRequests::cancel() {
  if (!isPending()) return;
  client_.cancelGoal();
  const std::lock_guard<std::mutex> lock(mutex_);
  pending_ = has_failed_ = false;
}

LocusRequests::Outcome LocusRequests::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  pending_ = false;
  const bool failed = !outcome_.reading;
  outcome_.is_final = failed && has_failed_;
  has_failed_ = failed && !has_failed_;
  return outcome_;
}

// ---- the vibration ----

void VibrationWindow::begin(const LocusRequest& window, const Exciter& exciter,
                            const ros::Time& origin) {
  window_.begin(window);
  exciter_ = exciter;
  origin_ = origin;
  for (const auto& samples : recent_) collect(*samples);
}

void VibrationWindow::add(const WrenchSamples::ConstPtr& samples) {
  recent_.push_back(samples);
  while (recent_.size() > kRecent &&
         (samples->header.stamp - recent_.front()->header.stamp).toSec() > kRecentTime) {
    recent_.pop_front();
  }
  collect(*samples);
}

void VibrationWindow::clear() {
  window_.cancel();
  recent_.clear();
}

void VibrationWindow::collect(const WrenchSamples& samples) {
  const std::size_t count = samples.wrench.size() / 6;
  if (count == 0 || !window_.window()) return;
  ExciterParameters drive;
  drive.frequency = exciter_.frequency;
  drive.phase = exciter_.phase;
  drive.direction = exciter_.direction;
  const double end =
      (samples.header.stamp - origin_).toSec() + static_cast<double>(count - 1) * samples.period;
  window_.add(samples.wrench.data(), count, samples.period, end, drive,
              (exciter_.header.stamp - origin_).toSec());
}

HarmonicFit VibrationWindow::take() {
  const double duration = window_.window()->duration;
  const std::size_t count = window_.angles().size();
  if (count < kMinSamples) {
    throw PlantError(
        AlignFailure::kNoReading,
        text("%zu samples of sensor_b/wrench_samples in a window of %g s", count, duration));
  }
  window_.cancel();
  return fitVibration(window_.angles(), window_.signals());
}

}  // namespace assembly_cell::ros_bridge
