// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/block_stamper.h"

#include <algorithm>
#include <cstdint>

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kShortestPeriod = 1e-5;  // of stamps [s]

std::chrono::nanoseconds span(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
}

}  // namespace

void BlockStamper::stampRecorded(const SourceBlock& block, StrainSamples& message) {
  if (paced_ && !stream_) {
    const std::chrono::duration<double> age = Clock::now() - block.received.steady;
    const auto length = static_cast<double>(block.count - 1);
    recording_start_ =
        ros::Time::now() - ros::Duration(age.count() + length * block.period + block.device_time);
  }
  message.header.stamp = !paced_ && recording_start_.isZero()
                             ? ros::Time(block.device_time)
                             : recording_start_ + ros::Duration(block.device_time);
}

void BlockStamper::stampLive(const SourceBlock& block, StrainSamples& message) {
  const auto length = static_cast<double>(block.count - 1);
  const StampFilter::Stamp stamp = filter_.update(block);
  if (stamp.period > 0.0) message.period = stamp.period;
  Clock::time_point start = stamp.time.steady;
  const Clock::time_point end = start + span(length * message.period);
  // stamps never go back: a block that overlaps the one before is shortened
  if (stream_ && start <= last_sample_) {
    const std::chrono::duration<double> left = end - last_sample_;
    message.period = std::max(left.count() / (length + 1.0), kShortestPeriod);
    start = last_sample_ + span(message.period);
  }
  last_sample_ = start + span(length * message.period);
  message.header.stamp = ros_clock_.at(start);
}

void BlockStamper::stamp(const SourceBlock& block, StrainSamples& message) {
  message.period = block.period;
  if (recorded_) {
    stampRecorded(block, message);
  } else {
    stampLive(block, message);
  }
  const bool gap = !recorded_ && stream_ && (isRestart(block) || block.sequence != next_sample_);
  sequence_ += gap ? 2 : 1;
  message.sequence = sequence_;
  stream_ = block.stream;
  next_sample_ = block.sequence + block.count;
}

}  // namespace assembly_cell::ros_bridge
