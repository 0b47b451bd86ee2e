// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/sensor_diagnostics.h"

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/process/ros_clock.h"

namespace assembly_cell::ros_bridge {

namespace {

using diagnostic_msgs::DiagnosticStatus;

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
constexpr const char* kTakenOver =
    "takeovers of the stream by another driver or program that reads the same device, which has "
    "one client at a time: end one of them";
constexpr Counter kCounters[] = {
    {&SourceCounters::samples, "samples", kOk, nullptr},
    {&SourceCounters::lost, "lost samples", kWarn, "samples lost"},
    {&SourceCounters::late, "late samples", kWarn, "samples too late"},
    {&SourceCounters::duplicates, "duplicate samples", kWarn, "samples twice"},
    {&SourceCounters::reordered, "reordered samples", kOk, nullptr},
    {&SourceCounters::faulty, "faulty samples", kError, "samples dropped for a fault"},
    {&SourceCounters::stale, "stale samples", kError, "stale samples: the device stalls"},
    {&SourceCounters::unnumbered, "unnumbered samples", kError,
     "samples dropped, whose number stays the same while the readings change: the device does not "
     "number its measurements: set drop_stale: false"},
    {&SourceCounters::crc_errors, "CRC errors", kWarn, "checksums wrong"},
    {&SourceCounters::garbage, "garbage bytes", kOk, nullptr},
    {&SourceCounters::malformed, "malformed frames", kWarn, "malformed frames"},
    {&SourceCounters::foreign, "foreign datagrams", kWarn, "datagrams from others"},
    {&SourceCounters::restarts, "device restarts", kWarn, "restarts of the stream"},
    {&SourceCounters::takeovers, "takeovers", kError, kTakenOver},
    {&SourceCounters::unread, "failed configuration reads", kWarn,
     "readings of the device's configuration failed: a change of it would not be noticed"},
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

/// One line in the terminal when a condition begins, and one when it is over.
void logChange(bool& logged, bool is_on, const std::string& cause, const char* over) {
  if (logged == is_on) return;
  logged = is_on;
  if (is_on) {
    ROS_ERROR_NAMED("driver", "%s", cause.c_str());
  } else {
    ROS_INFO_NAMED("driver", "%s", over);
  }
}

double seconds(SensorState::Clock::duration span) {
  return std::chrono::duration<double>(span).count();
}

bool gone(const LinkStatus& link) {
  return link.state == LinkState::kBackingOff || link.state == LinkState::kConnecting;
}

/// Static causes: the configuration must be changed.
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

/// Dynamic causes of the link: they pass by themselves, or with a cable. fault: the device's fault
/// word by name.
Causes passingCauses(const LinkStatus& link, const std::string& fault) {
  Causes out;
  if (!link.dynamic_cause.empty()) {
    const bool never = gone(link) && !link.ever_sampled;
    out.add(kError, link.dynamic_cause +
                        (never ? " (not once since the start: is it the right device?)" : ""));
  } else if (link.state == LinkState::kConnected && link.fault != 0) {
    out.add(kError, "the device reports: " + fault);
  } else if (link.state == LinkState::kConnected && !link.ever_sampled) {
    out.add(kWarn, "open, but no samples yet");
  }
  return out;
}

}  // namespace

SensorDiagnostics::SensorDiagnostics(ros::NodeHandle& nh, const ros::NodeHandle& pnh,
                                     const DriverSettings& settings, const std::string& source,
                                     SensorState& state, const SourceReader* reader)
    : settings_(settings),
      source_(source),
      state_(state),
      reader_(reader),
      updater_(nh, pnh, pnh.getNamespace()) {
  updater_.setHardwareID(state.pipeline.calibration().serial_number);
  updater_.add("samples", this, &SensorDiagnostics::diagnoseSamples);
  if (reader != nullptr) updater_.add("device", this, &SensorDiagnostics::diagnoseDevice);
  updater_.add("calibration", this, &SensorDiagnostics::diagnoseCalibration);
  // on the wall clock: a simulator that is paused must not silence the diagnostics
  timer_ = nh.createWallTimer(ros::WallDuration(settings.diagnostic_period),
                              [this](const ros::WallTimerEvent&) { updater_.force_update(); });
}

double SensorDiagnostics::expectedRate() const {
  if (settings_.expected_rate > 0.0 || reader_ == nullptr) return settings_.expected_rate;
  return reader_->acquisition().info().rate;
}

void SensorDiagnostics::diagnoseSamples(Status& status) {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  status.hardware_id = state_.pipeline.calibration().serial_number;
  const double silence =
      seconds(SensorState::Clock::now() - state_.last_block.value_or(state_.started));
  const StreamReport report = state_.pipeline.statistics().report();

  // causes since the last report, the worst last
  const auto warn = [&](const std::string& cause) { status.mergeSummary(kWarn, cause); };
  const auto fail = [&](const std::string& cause) { status.mergeSummary(kError, cause); };
  const bool ended = reader_ != nullptr && reader_->ended();
  status.summary(kOk, "");
  if (ended) {
    status.summary(kOk, "the recording has ended");
  } else if (silence > settings_.source_timeout) {
    // the simulator may be paused in lockstep
    status.summary(settings_.lockstep ? kWarn : kError,
                   state_.last_block ? "no samples for " + text("%.1f s", silence)
                                     : "no samples yet from " + source_);
  }
  if (report.malformed) fail("malformed: " + report.fault);
  if (report.saturated != 0) fail("saturated channels: " + channelText(report.saturated));
  diagnoseFrozen(status);
  if (report.outside != 0) {
    warn("load beyond the tests of the calibration, channels: " + channelText(report.outside));
  }
  if (report.lost > 0) warn(std::to_string(report.lost) + " blocks lost");
  if (report.duplicates > 0) {
    warn(std::to_string(report.duplicates) + " blocks twice or out of order");
  }
  if (report.restarts > 0) warn("the source restarted");
  if (!state_.foreign_frame.empty()) {
    warn("frame_id of blocks is '" + state_.foreign_frame + "', the node's is '" +
         settings_.frame_id + "'");
  }
  const double expected = expectedRate();
  if (!ended && report.rate > 0.0 && expected > 0.0 &&
      std::abs(report.rate - expected) > settings_.rate_tolerance * expected) {
    warn("rate " + text("%.4g Hz", report.rate) + " instead of " + text("%.4g Hz", expected));
  }
  if (status.message.empty()) {
    status.summary(kOk, "sampling at " + text("%.4g Hz", report.rate));
  }

  status.add("source", source_);
  status.add("rate [Hz]", report.rate);
  status.add("expected rate [Hz]", expected);
  status.add("age of last block [s]", state_.last_block ? silence : -1.0);
  status.add("samples", report.total_samples);
  status.add("lost blocks", report.total_lost);
  status.add("duplicate blocks", report.total_duplicates);
  status.add("source restarts", report.total_restarts);
  status.add("malformed blocks", report.total_malformed);
  status.add("saturated channels", channelText(report.saturated));
  status.add("saturated samples", report.total_saturated);
  if (std::isfinite(report.temperature)) status.add("temperature [degC]", report.temperature);
  for (int k = 0; k < 6; ++k) status.add(std::string("noise rms ") + kAxes[k], report.noise_rms[k]);
  status.add("samples in noise rms", report.noise_samples);
  state_.foreign_frame.clear();
}

// With the state locked.
void SensorDiagnostics::diagnoseFrozen(Status& status) {
  FrozenReadings& frozen = state_.pipeline.frozen();
  const bool is_frozen = frozen.isFrozen();
  const std::string found = frozen.report();
  if (!found.empty()) {
    status.mergeSummary(is_frozen ? kError : kWarn,
                        "frozen readings: " + found + (is_frozen ? kFrozenRemedy : ""));
  }
  status.add("equal readings in a row", frozen.run());
  logChange(reported_frozen_, is_frozen, "frozen readings: " + found + kFrozenRemedy,
            "the readings move again");
}

void SensorDiagnostics::diagnoseDevice(Status& status) {
  const LinkStatus link = reader_->acquisition().status();
  const SourceInfo info = reader_->acquisition().info();
  const SourceCounters counters = reader_->source().counters();
  const DeviceBias bias = reader_->source().deviceBias();
  const SourceReader::Timing timing = reader_->timing();
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    status.hardware_id = state_.pipeline.calibration().serial_number;
  }
  const auto now = SensorState::Clock::now();

  const Causes lasting = lastingCauses(link, info, status.hardware_id);
  const std::string fault = reader_->source().faultText(link.fault);
  const bool has_faults = link.fault != 0 && link.state == LinkState::kConnected;
  Causes passing = passingCauses(link, fault);
  for (const Counter& c : kCounters) {
    if (c.cause != nullptr) {
      passing.add(c.level, counters.*c.count - reported_counters_.*c.count, c.cause);
    }
  }
  passing.add(kWarn, link.dropped_samples - reported_link_.dropped_samples,
              "samples dropped: the driver is too slow");
  passing.add(kWarn, link.reconnects - reported_link_.reconnects, "reconnects");
  passing.add(kWarn, timing.clock_steps - reported_steps_, "steps of the system clock");
  logChange(reported_fault_, has_faults, info.device + " reports: " + fault,
            "the device reports no fault any more");
  logChange(reported_takeover_, counters.takeovers > reported_counters_.takeovers,
            info.device + ": " + kTakenOver, "the stream isn't taken over any more");
  reported_counters_ = counters;
  reported_link_ = link;
  reported_steps_ = timing.clock_steps;

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
  status.add("type", reader_->type());
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
  status.add("fault", link.fault == 0 ? "none" : fault);
  status.add("dropped blocks", link.dropped_blocks);
  status.add("dropped samples", link.dropped_samples);
  status.add("most blocks in queue", link.queue_high);
  status.add("clock steps", timing.clock_steps);
  status.add("last clock step [s]", timing.last_clock_step);
  status.add("delay median [ms]", 1e3 * timing.delays.percentile(0.5));
  status.add("delay p99 [ms]", 1e3 * timing.delays.percentile(0.99));
  status.add("delays", timing.delays.count());
  if (bias.state != DeviceBias::State::kNone) {
    const char* states[] = {"none", "pending", "verified", "failed"};
    status.add("device bias", states[static_cast<std::size_t>(bias.state)]);
    status.add("device bias residual", wrenchText(Vector6::Map(bias.residual.data()), "%.3g"));
  }
}

void SensorDiagnostics::diagnoseCalibration(Status& status) {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  const Calibration& calibration = state_.pipeline.calibration();
  const auto& bias_time = state_.bias_time;
  status.hardware_id = calibration.serial_number;
  status.summary(kOk, "calibration " + calibration.id + (bias_time ? ", zeroed" : ", not zeroed"));
  status.add("serial number", calibration.serial_number);
  status.add("calibration id", calibration.id);
  status.add("calibration date", calibration.date);
  status.add("calibration in force [s]", age(state_.calibration_time));
  status.add("model", calibration.quadratic_wrench ? "quadratic" : "linear");
  if (bias_time) {
    status.add("bias age [s]", age(*bias_time));
  } else {
    status.add("bias age [s]", "never set");
  }
  for (int k = 0; k < 6; ++k) {
    status.add(std::string("bias ") + kAxes[k], state_.pipeline.bias()[k]);
  }
}

}  // namespace assembly_cell::ros_bridge
