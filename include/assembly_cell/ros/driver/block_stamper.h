// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <chrono>
#include <cstdint>
#include <optional>

#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/ros/process/ros_clock.h"
#include "assembly_cell/sensor/stamp_filter.h"

namespace assembly_cell::ros_bridge {

/// Stamps and numbers of a source's blocks. Stamps are those of a device by the arrival of its
/// blocks (StampFilter), of a recording by the recording's own time base. A gap in the samples is a
/// gap in the numbers.
class BlockStamper {
 public:
  /// start: of a recording that has one, otherwise zero.
  BlockStamper(const SourceInfo& info, const ros::Time& start)
      : recorded_(info.recorded), paced_(info.paced), recording_start_(start) {}

  /// The source has been opened or has restarted since the last block that was stamped.
  bool isRestart(const SourceBlock& block) const { return !stream_ || block.stream != *stream_; }
  /// Sets the message's stamp, period and sequence.
  void stamp(const SourceBlock& block, StrainSamples& message);

  const RosClock& clock() const { return ros_clock_; }

 private:
  using Clock = std::chrono::steady_clock;

  void stampRecorded(const SourceBlock& block, StrainSamples& message);
  void stampLive(const SourceBlock& block, StrainSamples& message);

  const bool recorded_, paced_;
  ros::Time recording_start_;
  StampFilter filter_;
  Clock::time_point last_sample_{};
  RosClock ros_clock_;
  std::optional<std::uint32_t> stream_;
  std::uint64_t next_sample_ = 0;         // sequence of the sample that should follow
  std::uint32_t sequence_ = 0xffffffffu;  // of the latest block; the first one is 0
};

}  // namespace assembly_cell::ros_bridge
