// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// How the driver takes blocks from a source and stamps them.
#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/driver/force_sensor_node.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kShortestPeriod = 1e-5;                    // of stamps [s]
constexpr auto kPatience = std::chrono::milliseconds(100);  // of a wait for blocks

}  // namespace

void ForceSensorNode::publishBlocks() {
  try {
    publishAll();
  } catch (const std::exception& error) {
    ROS_ERROR_NAMED("driver", "%s", error.what());
    acquisition_->misconfigured(error.what());
  }
}

void ForceSensorNode::publishAll() {
  // as fast as possible: nobody would see the beginning without someone listening
  while (recorded_ && !paced_ && !stopping_ && wrench_samples_pub_.getNumSubscribers() == 0 &&
         wrench_pub_.getNumSubscribers() == 0 && wrench_raw_pub_.getNumSubscribers() == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  // a block that waits for its publisher is as late as one that waits to be read
  raisePriority(priority_);
  acquisition_->start();
  bool ended = false;
  while (!stopping_) {
    if (const SourceBlock* block = acquisition_->next(kPatience)) {
      publishSource(*block);
      const std::lock_guard<std::mutex> lock(mutex_);
      delays_.add(std::chrono::duration<double>(Clock::now() - block->received.steady).count());
    } else if (!ended && acquisition_->done()) {
      ended = true;
      if (acquisition_->status().state == LinkState::kEnded) {
        replay_ended_ = true;
        ROS_INFO_NAMED("driver", "the recording has ended");
      }
    } else if (ended) {
      std::this_thread::sleep_for(kPatience);
    } else {
      tellLink();
    }
  }
}

void ForceSensorNode::tellLink() {
  const LinkStatus link = acquisition_->status();
  const std::string& cause = link.static_cause.empty() ? link.dynamic_cause : link.static_cause;
  if (cause.empty() || cause == told_) return;
  told_ = cause;
  ROS_WARN_NAMED("driver", "%s (trying again)", cause.c_str());
}

void ForceSensorNode::publishSource(const SourceBlock& block) {
  const bool anew = !stream_ || block.stream != *stream_;
  if (anew && !beginStream()) return;

  auto message = boost::make_shared<StrainSamples>();
  message->header.frame_id = frame_id_;
  stampBlock(block, !stream_, *message);
  // the number of a block that isn't the next one tells everybody of the gap
  const bool gap = !recorded_ && stream_ && (anew || block.sequence != next_sample_);
  block_sequence_ += gap ? 2 : 1;
  message->sequence = block_sequence_;
  stream_ = block.stream;
  next_sample_ = block.sequence + block.count;

  message->volts.assign(block.values.begin(),
                        block.values.begin() + static_cast<std::ptrdiff_t>(6 * block.count));
  message->saturated.assign(block.saturated.begin(),
                            block.saturated.begin() + static_cast<std::ptrdiff_t>(block.count));
  message->temperature = block.temperature;
  if (quantity_ == SampleQuantity::kWrench) markOutOfRange(*message);
  if (anew) {
    const std::lock_guard<std::mutex> lock(mutex_);
    noise_.breakRun();  // the seam is no noise
    if (zero_.active && !recorded_) zero_.failure = "the device started anew: try again";
  }
  process(message);
}

// A value that the sensor can't measure (an end of its numbers, a code for a fault) is none.
void ForceSensorNode::markOutOfRange(StrainSamples& block) const {
  for (std::size_t k = 0; k < block.volts.size(); ++k) {
    const std::size_t channel = k % 6;
    if (std::abs(block.volts[k]) <= (channel < 3 ? range_force_ : range_torque_)) continue;
    std::uint8_t& marks = block.saturated[k / 6];
    marks = static_cast<std::uint8_t>(marks | 1u << channel);
  }
}

bool ForceSensorNode::beginStream() {
  const SourceInfo info = acquisition_->info();
  const bool wrench = info.quantity == SampleQuantity::kWrench;
  std::string fault;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    quantity_ = info.quantity;
    quantity_known_ = true;
    try {
      checkUse(calibration_, calibrated_ ? "calibration '" + calibration_.id + "'"
                                         : "calibration_file is not set");
    } catch (const InputError& error) {
      fault = error.what();
    }
    if (fault.empty() && !calibrated_ && !info.serial_number.empty() &&
        calibration_.serial_number != info.serial_number) {
      calibration_.serial_number = info.serial_number;
      publishCalibration();
    }
  }
  if (!fault.empty()) {
    ROS_ERROR_NAMED("driver", "%s", fault.c_str());
    acquisition_->misconfigured(fault);
    return false;
  }
  if (!wrench && !strain_pub_) advertiseStrain();
  if (!told_.empty()) ROS_INFO_NAMED("driver", "samples from %s", info.device.c_str());
  told_.clear();
  return true;
}

void ForceSensorNode::stampBlock(const SourceBlock& block, bool first, StrainSamples& message) {
  const auto length = static_cast<double>(block.count - 1);
  message.period = block.period;
  if (recorded_ && paced_) {
    // on the recording's own time base, which begins with the first block
    if (first) {
      const std::chrono::duration<double> age = Clock::now() - block.received.steady;
      recording_start_ =
          ros::Time::now() - ros::Duration(age.count() + length * block.period + block.device_time);
    }
    message.header.stamp = recording_start_ + ros::Duration(block.device_time);
  } else if (recorded_) {
    message.header.stamp = recording_start_.isZero()
                               ? ros::Time(block.device_time)
                               : recording_start_ + ros::Duration(block.device_time);
  } else {
    const StampFilter::Stamp stamp = stamp_filter_.update(block);
    if (stamp.period > 0.0) message.period = stamp.period;
    const auto span = [&](double seconds) {
      return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
    };
    Clock::time_point start = stamp.time.steady;
    const Clock::time_point end = start + span(length * message.period);
    // stamps never go back: what came in too short a time is told in that time
    if (!first && start <= last_sample_) {
      const std::chrono::duration<double> left = end - last_sample_;
      message.period = std::max(left.count() / (length + 1.0), kShortestPeriod);
      start = last_sample_ + span(message.period);
    }
    last_sample_ = start + span(length * message.period);
    const std::lock_guard<std::mutex> lock(mutex_);
    message.header.stamp = ros_clock_.at(start);
  }
}

}  // namespace assembly_cell::ros_bridge
