// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/replay_source.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

ReplaySource::ReplaySource() { info_.type = "replay"; }

void ReplaySource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, "source " + info_.type);
  file_ = parameters.text("file");
  const std::string quantity =
      parameters.choice("quantity", {"counts", "volts", "wrench"}, "wrench");
  format_.quantity = quantity == "counts"  ? SampleQuantity::kCounts
                     : quantity == "volts" ? SampleQuantity::kVolts
                                           : SampleQuantity::kWrench;
  format_.columns = parameters.texts("columns", std::vector<std::string>());
  format_.bits = parameters.integer("bits", 2, 32, 16);
  format_.full_scale = parameters.number("full_scale", 1e-9, 1e9, 5.0);
  const std::string unit = parameters.choice("time_unit", timeUnitNames(), "auto");
  for (const auto& [name, value] : kTimeUnitChoices) {
    if (name == unit) format_.time_unit = value;
  }
  paced_ = parameters.choice("rate", {"original", "fast"}, "original") == "original";
  loop_ = parameters.flag("loop", false);
  block_size_ = static_cast<std::size_t>(
      parameters.integer("block_size", 1, static_cast<int>(kBlockCapacity), 1));
  parameters.refuseUnknown();
  info_.device = file_;
  info_.quantity = format_.quantity == SampleQuantity::kWrench ? SampleQuantity::kWrench
                                                               : SampleQuantity::kVolts;
  info_.bits = format_.quantity == SampleQuantity::kCounts ? format_.bits : 0;
  info_.full_scale = format_.quantity == SampleQuantity::kWrench ? 0.0 : format_.full_scale;
  info_.recorded = true;
  info_.paced = paced_;
}

void ReplaySource::doOpen() {
  replay_ = std::make_unique<Replay>(loadRecording(file_, format_), block_size_, loop_);
  info_.note = replay_->recording().note;
  info_.rate = 1.0 / replay_->recording().period;
  has_due_ = replay_->next(due_);
  origin_ = due_.time;
  ++stream_;
  start_ = Clock::now();
}

ReadResult ReplaySource::doRead(SourceBlock& block, Clock::time_point deadline) {
  if (!has_due_) return ReadResult::kEnd;
  const Recording& recording = replay_->recording();

  // a block is due with its last sample
  const double last =
      recording.time[due_.first + due_.size - 1] - recording.time[due_.first] + due_.time;
  const Clock::time_point due = paced_ ? start_ + nanoseconds(last - origin_) : Clock::now();
  if (paced_) {
    const Wait waited = wait(-1, std::min(due, deadline));
    if (waited == Wait::kStopped) return ReadResult::kClosed;
    if (Clock::now() < due) return ReadResult::kTimeout;
  }

  for (std::size_t i = 0; i < due_.size; ++i) {
    const Vector6& value = recording.values[due_.first + i];
    std::copy(value.begin(), value.end(), block.values.begin() + 6 * i);
    block.saturated[i] = recording.saturated[due_.first + i];
  }
  block.count = due_.size;
  block.sequence = sequence_;
  block.stream = stream_;
  block.period = recording.period;
  block.device_time = due_.time;
  block.received = receptionAt(due);
  sequence_ += due_.size;
  counts_.samples += due_.size;
  has_due_ = replay_->next(due_);
  return ReadResult::kSamples;
}

}  // namespace assembly_cell
