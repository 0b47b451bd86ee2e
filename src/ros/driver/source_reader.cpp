// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/source_reader.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/driver/bag_source.h"
#include "assembly_cell/sensor/reception.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr auto kPatience = std::chrono::milliseconds(100);  // of a wait for blocks
constexpr auto kConnectionPatience = std::chrono::seconds(5);

AcquisitionOptions acquisitionOptions(const SourceSettings& s, const SourceInfo& info,
                                      double source_timeout) {
  AcquisitionOptions options;
  options.queue = static_cast<std::size_t>(s.queue_size);
  options.read_timeout = nanoseconds(s.read_timeout);
  options.first_back_off = nanoseconds(s.back_off);
  options.longest_back_off = std::max(options.first_back_off, nanoseconds(s.longest_back_off));
  options.priority = s.realtime_priority;
  // a recording may pause, and loses nothing
  options.silence =
      info.recorded ? std::chrono::nanoseconds(0) : nanoseconds(std::max(source_timeout, 0.1));
  options.lossless = info.recorded || !info.paced;
  return options;
}

// A value beyond what the sensor can measure is an end of its numbers, or a code for a fault.
void markOutOfRange(const SourceSettings& settings, StrainSamples& block) {
  for (std::size_t k = 0; k < block.volts.size(); ++k) {
    const std::size_t channel = k % 6;
    const double range = channel < 3 ? settings.range_force : settings.range_torque;
    if (std::abs(block.volts[k]) <= range) continue;
    std::uint8_t& marks = block.saturated[k / 6];
    marks = static_cast<std::uint8_t>(marks | 1u << channel);
  }
}

// For a source that is read as fast as possible: a subscriber that connects later would miss its
// beginning, or everything. A subscriber that died without unregistering doesn't block it forever.
void awaitSubscribers(const SensorState& state, const SensorOutput& output) {
  while (!state.stopping && !output.hasSubscribers()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const auto limit = SensorState::Clock::now() + kConnectionPatience;
  while (!state.stopping && SensorState::Clock::now() < limit && !output.allConnected()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

SourceReader::SourceReader(SourceChoice choice, const SourceSettings& settings,
                           double source_timeout, SensorState& state)
    : choice_(std::move(choice)), settings_(settings), state_(state) {
  // a recording must be right at once; a device may come later
  if (source().info().recorded) source().open();
  const SourceInfo& info = source().info();
  acquisition_ =
      std::make_unique<Acquisition>(source(), acquisitionOptions(settings, info, source_timeout));
  const auto* bag = dynamic_cast<const BagSource*>(&source());
  stamper_.emplace(info, bag != nullptr ? bag->start() : ros::Time());
}

void SourceReader::start(SensorOutput& output, const std::string& frame_id) {
  output_ = &output;
  frame_id_ = frame_id;
  thread_ = std::thread([this] {
    try {
      publishAll();
    } catch (const std::exception& error) {
      ROS_ERROR_NAMED("driver", "%s", error.what());
      acquisition_->misconfigured(error.what());
    }
  });
}

void SourceReader::stop() {
  acquisition_->stop();
  if (thread_.joinable()) thread_.join();
}

SourceReader::Timing SourceReader::timing() const {
  const std::lock_guard<std::mutex> lock(timing_mutex_);
  return {delays_, stamper_->clock().steps(), stamper_->clock().lastStep()};
}

void SourceReader::publishAll() {
  if (isFast(source().info())) awaitSubscribers(state_, *output_);
  // a block that waits for its publisher is as late as one that waits to be read
  raisePriority(settings_.realtime_priority);
  acquisition_->start();
  bool done = false;
  while (!state_.stopping) {
    if (const SourceBlock* block = acquisition_->next(kPatience)) {
      publish(*block);
      const std::lock_guard<std::mutex> lock(timing_mutex_);
      delays_.add(std::chrono::duration<double>(SensorState::Clock::now() - block->received.steady)
                      .count());
    } else if (!done && acquisition_->done()) {
      done = true;
      if (acquisition_->status().state == LinkState::kEnded) {
        ended_ = true;
        ROS_INFO_NAMED("driver", "the recording has ended");
      }
    } else if (done) {
      std::this_thread::sleep_for(kPatience);
    } else {
      logLink();
    }
  }
}

void SourceReader::logLink() {
  const LinkStatus link = acquisition_->status();
  const std::string& cause = link.static_cause.empty() ? link.dynamic_cause : link.static_cause;
  if (cause.empty() || cause == logged_cause_) return;
  logged_cause_ = cause;
  ROS_WARN_NAMED("driver", "%s (trying again)", cause.c_str());
}

void SourceReader::publish(const SourceBlock& block) {
  const bool restarted = stamper_->isRestart(block);
  if (restarted && !beginStream()) return;

  auto message = boost::make_shared<StrainSamples>();
  message->header.frame_id = frame_id_;
  {
    const std::lock_guard<std::mutex> lock(timing_mutex_);
    stamper_->stamp(block, *message);
  }
  message->volts.assign(block.values.begin(),
                        block.values.begin() + static_cast<std::ptrdiff_t>(6 * block.count));
  message->saturated.assign(block.saturated.begin(),
                            block.saturated.begin() + static_cast<std::ptrdiff_t>(block.count));
  message->temperature = block.temperature;
  if (state_.rules.quantity == SampleQuantity::kWrench) markOutOfRange(settings_, *message);
  if (restarted) {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.pipeline.onDeviceRestart(source().info().recorded);
  }
  output_->process(message);
}

bool SourceReader::beginStream() {
  const SourceInfo info = acquisition_->info();
  std::string fault;
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    const Calibration& calibration = state_.pipeline.calibration();
    CalibrationRules& rules = state_.rules;
    rules.quantity = info.quantity;
    try {
      rules.check(calibration, rules.calibrated ? "calibration '" + calibration.id + "'"
                                                : "calibration_file is not set");
    } catch (const InputError& error) {
      fault = error.what();
    }
    if (fault.empty() && !rules.calibrated && !info.serial_number.empty() &&
        calibration.serial_number != info.serial_number) {
      state_.pipeline.setSerialNumber(info.serial_number);
      output_->publishCalibration();
    }
  }
  if (!fault.empty()) {
    ROS_ERROR_NAMED("driver", "%s", fault.c_str());
    acquisition_->misconfigured(fault);
    return false;
  }
  if (info.quantity != SampleQuantity::kWrench && !output_->hasStrain()) {
    output_->advertiseStrain();
  }
  if (!logged_cause_.empty()) {
    ROS_INFO_NAMED("driver", "samples from %s", info.device.c_str());
  }
  logged_cause_.clear();
  return true;
}

}  // namespace assembly_cell::ros_bridge
