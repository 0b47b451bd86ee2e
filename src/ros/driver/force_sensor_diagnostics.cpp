// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/force_sensor_node.h"

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr std::size_t kNoiseSamples = 50;  // differences in one estimate of the noise
constexpr const char* kAxes[6] = {"fx [N]", "fy [N]", "fz [N]", "tx [N m]", "ty [N m]", "tz [N m]"};

/// A number that a source counts: its key, and what it means when it grows (null: nothing).
struct Counter {
  std::uint64_t SourceCounters::*count;
  const char* key;
  std::uint8_t level;
  const char* cause;
};
constexpr std::uint8_t kOk = DiagnosticStatus::OK, kWarn = DiagnosticStatus::WARN,
                       kError = DiagnosticStatus::ERROR;
constexpr Counter kCounters[] = {
    {&SourceCounters::samples, "samples", kOk, nullptr},
    {&SourceCounters::lost, "lost samples", kWarn, "samples lost"},
    {&SourceCounters::late, "late samples", kWarn, "samples too late"},
    {&SourceCounters::duplicates, "duplicate samples", kWarn, "samples twice"},
    {&SourceCounters::reordered, "reordered samples", kOk, nullptr},
    {&SourceCounters::faulty, "faulty samples", kError, "samples dropped for a fault"},
    {&SourceCounters::stale, "stale samples", kError, "stale samples: the device stalls"},
    {&SourceCounters::crc_errors, "CRC errors", kWarn, "checksums wrong"},
    {&SourceCounters::garbage, "garbage bytes", kOk, nullptr},
    {&SourceCounters::malformed, "malformed frames", kWarn, "malformed frames"},
    {&SourceCounters::foreign, "foreign datagrams", kWarn, "datagrams from others"},
    {&SourceCounters::restarts, "device restarts", kWarn, "restarts of the device"},
};

/// Causes in one line, and the worst of their levels.
struct Causes {
  std::string text;
  std::uint8_t level = kOk;

  void add(std::uint8_t of_cause, const std::string& cause) {
    text += (text.empty() ? "" : "; ") + cause;
    level = std::max(level, of_cause);
  }
  void add(std::uint8_t of_cause, std::uint64_t count, const char* what) {
    if (count > 0) add(of_cause, std::to_string(count) + " " + what);
  }
};

bool gone(const LinkStatus& link) {
  return link.state == LinkState::kBackingOff || link.state == LinkState::kConnecting;
}

/// Static causes: somebody must change something.
Causes lastingCauses(const LinkStatus& link, const SourceInfo& info, const std::string& serial) {
  Causes out;
  if (!link.static_cause.empty()) out.add(kError, link.static_cause);
  if (link.opens > 0 && !info.serial_number.empty() && info.serial_number != serial) {
    out.add(
        info.quantity == SampleQuantity::kWrench ? kWarn : kError,
        "the device is '" + info.serial_number + "' but the calibration is of '" + serial + "'");
  }
  if (!link.priority_fault.empty()) out.add(kWarn, link.priority_fault);
  return out;
}

/// Dynamic causes of the link: they pass by themselves, or with a cable.
Causes passingCauses(const LinkStatus& link) {
  Causes out;
  if (!link.dynamic_cause.empty()) {
    const bool never = gone(link) && !link.ever_sampled;
    out.add(kError, link.dynamic_cause +
                        (never ? " (not once since the start: is it the right device?)" : ""));
  } else if (link.state == LinkState::kConnected && link.fault != 0) {
    out.add(kError, "the device reports a fault");
  } else if (link.state == LinkState::kConnected && !link.ever_sampled) {
    out.add(kWarn, "open, but no samples yet");
  }
  return out;
}

}  // namespace

void ForceSensorNode::diagnoseSamples(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.hardware_id = calibration_.serial_number;
  const std::chrono::duration<double> silence = Clock::now() - last_block_.value_or(started_);
  if (rate_samples_ > 0 && last_time_ > rate_from_) {
    rate_ = static_cast<double>(rate_samples_) / (last_time_ - rate_from_);
    rate_from_ = last_time_;
    rate_samples_ = 0;
  }
  // the first estimate grows with its samples; then each one is complete
  if (noise_.count() >= kNoiseSamples || noise_.count() > noise_samples_) {
    noise_rms_ = noise_.rms();
    noise_samples_ = noise_.count();
    if (noise_samples_ >= kNoiseSamples) noise_.clear();
  }
  const std::uint64_t lost = sequence_.lost() - reported_lost_;
  const std::uint64_t duplicates = sequence_.duplicates() - reported_duplicates_;
  const std::uint64_t restarts = sequence_.restarts() - reported_restarts_;
  reported_lost_ = sequence_.lost();
  reported_duplicates_ = sequence_.duplicates();
  reported_restarts_ = sequence_.restarts();

  // causes since the last report, the worst last
  const auto warn = [&](const std::string& text) { status.mergeSummary(kWarn, text); };
  const auto fail = [&](const std::string& text) { status.mergeSummary(kError, text); };
  status.summary(kOk, "");
  if (replay_ended_) {
    status.summary(kOk, "the recording has ended");
  } else if (silence > source_timeout_) {
    // the simulator may be paused in lockstep
    status.summary(lockstep_ ? kWarn : kError,
                   last_block_ ? "no samples for " + text("%.1f s", silence.count())
                               : "no samples yet from " + source_);
  }
  if (window_.malformed > 0) fail("malformed: " + fault_);
  if (window_.saturated != 0) fail("saturated channels: " + channelText(window_.saturated));
  if (window_.outside != 0) {
    warn("load beyond the tests of the calibration, channels: " + channelText(window_.outside));
  }
  if (lost > 0) warn(std::to_string(lost) + " blocks lost");
  if (duplicates > 0) warn(std::to_string(duplicates) + " blocks twice or out of order");
  if (restarts > 0) warn("the source started anew");
  if (!foreign_frame_.empty()) {
    warn("blocks say they're from '" + foreign_frame_ + "', frame_id is '" + frame_id_ + "'");
  }
  // a device may know its own rate
  const double expected =
      expected_rate_ > 0.0 || !acquisition_ ? expected_rate_ : acquisition_->info().rate;
  if (!replay_ended_ && rate_ > 0.0 && expected > 0.0 &&
      std::abs(rate_ - expected) > rate_tolerance_ * expected) {
    warn("rate " + text("%.4g Hz", rate_) + " instead of " + text("%.4g Hz", expected));
  }
  if (status.message.empty()) {
    status.summary(kOk, "sampling at " + text("%.4g Hz", rate_));
  }
  total_samples_ += window_.samples;
  total_saturated_ += window_.saturated_samples;
  total_malformed_ += window_.malformed;

  status.add("source", source_);
  status.add("rate [Hz]", rate_);
  status.add("expected rate [Hz]", expected);
  status.add("age of last block [s]", last_block_ ? silence.count() : -1.0);
  status.add("samples", total_samples_);
  status.add("lost blocks", sequence_.lost());
  status.add("duplicate blocks", sequence_.duplicates());
  status.add("source restarts", sequence_.restarts());
  status.add("malformed blocks", total_malformed_);
  status.add("saturated channels", channelText(window_.saturated));
  status.add("saturated samples", total_saturated_);
  if (std::isfinite(temperature_)) status.add("temperature [degC]", temperature_);
  for (int k = 0; k < 6; ++k) status.add(std::string("noise rms ") + kAxes[k], noise_rms_[k]);
  status.add("samples in noise rms", noise_samples_);
  window_ = Window();
  foreign_frame_.clear();
}

void ForceSensorNode::diagnoseDevice(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const LinkStatus link = acquisition_->status();
  const SourceInfo info = acquisition_->info();
  const SourceCounters counters = choice_.source->counters();
  const DeviceBias bias = choice_.source->deviceBias();
  std::unique_lock<std::mutex> lock(mutex_);
  const Delays delays = delays_;
  lock.unlock();
  const double median = delays.percentile(0.5), p99 = delays.percentile(0.99);
  lock.lock();
  status.hardware_id = calibration_.serial_number;
  const auto now = Clock::now();
  const auto seconds = [](auto span) { return std::chrono::duration<double>(span).count(); };

  const Causes lasting = lastingCauses(link, info, calibration_.serial_number);
  Causes passing = passingCauses(link);
  for (const Counter& c : kCounters) {
    if (c.cause != nullptr) {
      passing.add(c.level, counters.*c.count - reported_counters_.*c.count, c.cause);
    }
  }
  passing.add(kWarn, link.dropped_samples - reported_link_.dropped_samples,
              "samples dropped: the driver is too slow");
  passing.add(kWarn, link.reconnects - reported_link_.reconnects, "reconnects");
  passing.add(kWarn, ros_clock_.steps() - reported_steps_, "steps of the system clock");
  reported_counters_ = counters;
  reported_link_ = link;
  reported_steps_ = ros_clock_.steps();

  status.summary(kOk, "");
  if (!lasting.text.empty()) {
    status.mergeSummary(lasting.level, "configuration: " + lasting.text);
  }
  if (!passing.text.empty()) status.mergeSummary(passing.level, passing.text);
  if (status.message.empty()) {
    status.summary(
        kOk, std::string(toText(link.state)) + (info.device.empty() ? "" : " to " + info.device));
  }

  status.add("state", toText(link.state));
  status.add("static cause", lasting.text);
  status.add("dynamic cause", passing.text);
  status.add("last loss", link.last_loss);
  status.add("type", choice_.type);
  status.add("device", info.device);
  status.add("device serial number", info.serial_number);
  status.add("firmware", info.firmware);
  status.add("note", info.note);
  status.add("quantity", toText(info.quantity));
  status.add("opens", link.opens);
  status.add("failed opens", link.failed_opens);
  status.add("reconnects", link.reconnects);
  status.add("back-off [s]", seconds(link.back_off));
  status.add("next attempt in [s]",
             gone(link) ? std::max(0.0, seconds(link.next_attempt - now)) : 0.0);
  status.add("age of last samples [s]",
             link.ever_sampled ? seconds(now - link.last_samples) : -1.0);
  for (const Counter& c : kCounters) status.add(c.key, counters.*c.count);
  status.add("fault word", text("0x%08x", link.fault));
  status.add("dropped blocks", link.dropped_blocks);
  status.add("dropped samples", link.dropped_samples);
  status.add("most blocks in queue", link.queue_high);
  status.add("clock steps", ros_clock_.steps());
  status.add("last clock step [s]", ros_clock_.lastStep());
  status.add("delay median [ms]", 1e3 * median);
  status.add("delay p99 [ms]", 1e3 * p99);
  status.add("delays", delays.count());
  if (bias.state != DeviceBias::State::kNone) {
    const char* states[] = {"none", "pending", "verified", "failed"};
    status.add("device bias", states[static_cast<std::size_t>(bias.state)]);
    status.add("device bias residual", wrenchText(Vector6::Map(bias.residual.data()), "%.3g"));
  }
}

void ForceSensorNode::diagnoseCalibration(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.hardware_id = calibration_.serial_number;
  status.summary(kOk,
                 "calibration " + calibration_.id + (bias_time_ ? ", zeroed" : ", not zeroed"));
  status.add("serial number", calibration_.serial_number);
  status.add("calibration id", calibration_.id);
  status.add("calibration date", calibration_.date);
  status.add("calibration in force [s]", age(calibration_time_));
  status.add("model", calibration_.quadratic_wrench ? "quadratic" : "linear");
  if (bias_time_) {
    status.add("bias age [s]", age(*bias_time_));
  } else {
    status.add("bias age [s]", "never set");
  }
  for (int k = 0; k < 6; ++k) status.add(std::string("bias ") + kAxes[k], bias_[k]);
}

}  // namespace assembly_cell::ros_bridge
