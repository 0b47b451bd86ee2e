// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/records/run_recorder.h"

#include <algorithm>
#include <chrono>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/records/align_record.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kFreshState = 3.0;      // age of a recorder's state, wall clock [s]
constexpr std::size_t kMaxHolds = 1000;  // of one goal

}  // namespace

void fields(FieldList& f, RecordSettings& s) {
  f.choice("record", s.record, {"off", "best_effort", "required"},
           "Goals align and assemble are stored by assembly_recorder before their result; "
           "best_effort: a warning where one isn't; required: refused before anything moves where "
           "it can't be, failed where it was not.");
  f.number("record_timeout", s.record_timeout, {0.01, 60.0, "s"},
           "Longest wait for the recorder's answer, wall clock; multiplied by slow_factor.");
}

RunRecorder::RunRecorder(ros::NodeHandle& nh, const RecordSettings& settings, double slow_factor)
    : settings_(settings) {
  settings_.record_timeout *= slow_factor;
  record_pub_ = nh.advertise<AssemblyRecord>("run_record", 10);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  state_sub_ = subscribeChecked<RecorderState>(
      nh, "recorder_state", 10, [this](const RecorderState::ConstPtr& state) { onState(*state); });
  verdict_sub_ = subscribeChecked<AssemblyVerdict>(
      nh, "run_verdict", 10,
      [this](const AssemblyVerdict::ConstPtr& verdict) { onVerdict(*verdict); }, hints);
  plant_sub_ = subscribeChecked<PlantState>(
      nh, "plant_state", 10, [this](const PlantState::ConstPtr& plant) { onPlant(*plant); });
}

void RunRecorder::onState(const RecorderState& state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  state_ = state;
  received_ = ros::WallTime::now();
}

void RunRecorder::onVerdict(const AssemblyVerdict& verdict) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!pending_ || verdict.goal_id != *pending_) return;
  verdict_ = verdict;
  pending_.reset();
  changed_.notify_all();
}

void RunRecorder::onPlant(const PlantState& plant) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool begins = plant.held && !is_held_;
  is_held_ = plant.held;
  if (begins && holds_.size() < kMaxHolds) holds_.push_back({plant.header.stamp, plant.reason});
}

std::string RunRecorder::complaint() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (received_.isZero()) return "no message on recorder_state: is assembly_recorder running?";
  const double age = (ros::WallTime::now() - received_).toSec();
  if (age > kFreshState) {
    return text("no message on recorder_state for %.0f s: is assembly_recorder running?", age);
  }
  if (!state_.writable) return printable(state_.reason, 500);
  if (record_pub_.getNumSubscribers() == 0) {
    return "assembly_recorder does not subscribe to run_record yet";
  }
  return {};
}

void RunRecorder::begin() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    holds_.clear();
    run_.events.clear();
  }
  if (!isRequired()) return;
  const std::string why = complaint();
  if (!why.empty()) throw InputError("~record is required, and no record can be stored: " + why);
}

void RunRecorder::add(const AlignProgress& progress) {
  const std::lock_guard<std::mutex> lock(mutex_);
  addEvent(progress, run_);
}

void RunRecorder::addEvents(AssemblyRecord& record, const ros::Time& origin,
                            const std::string& cancelled_by, const AlignResult& result) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<RunEvent> events = run_.events;
  for (const Hold& hold : holds_) {
    events.push_back({(hold.stamp - origin).toSec(), "hold", hold.reason});
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const RunEvent& a, const RunEvent& b) { return a.time < b.time; });
  if (result.failure == AlignFailure::kCancelled) {
    events.push_back({record.duration, "cancelled", "by " + cancelled_by});
  } else if (!result.success) {
    events.push_back({record.duration, "fault", result.reason});
  }
  for (const RunEvent& event : events) {
    record.events.push_back(event.kind);
    record.event_times.push_back(event.time);
    record.event_texts.push_back(event.text);
  }
}

void RunRecorder::store(AssemblyRecord& record, const ros::Time& origin,
                        const std::string& cancelled_by, AlignResult& result,
                        AlignmentReport& report) {
  addEvents(record, origin, cancelled_by, result);
  const Answer answer = publish(record);
  report.record = answer.id;
  if (answer.id != 0) {
    report.verdict = answer.text;
    return;
  }
  ROS_WARN("not recorded: %s", answer.text.c_str());
  if (!isRequired()) return;
  report.success = false;
  result.success = false;
  result.reason = "not recorded: " + answer.text + " (" + result.reason + ")";
  report.reason = result.reason;
}

RunRecorder::Answer RunRecorder::publish(const AssemblyRecord& record) {
  if (record_pub_.getNumSubscribers() == 0) {
    return {0, "no subscriber of run_record: is assembly_recorder running?"};
  }
  std::unique_lock<std::mutex> lock(mutex_);
  pending_ = record.goal_id;
  publishShared(record_pub_, record);
  const bool answered = changed_.wait_for(
      lock, std::chrono::duration<double>(settings_.record_timeout), [this] { return !pending_; });
  pending_.reset();
  if (!answered) {
    return {0, text("no answer of assembly_recorder within %g s of wall time: is it running?",
                    settings_.record_timeout)};
  }
  if (!verdict_.stored) return {0, printable(verdict_.message, 500)};
  return {verdict_.id, printable(verdict_.message, 500)};
}

}  // namespace assembly_cell::ros_bridge
