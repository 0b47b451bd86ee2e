// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/simulated_source.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

namespace {

constexpr double kLargestLoad = 1e6;  // [N], [N·m]

}  // namespace

SimulatedSource::SimulatedSource() {
  info_.type = "simulated";
  info_.quantity = SampleQuantity::kVolts;
}

void SimulatedSource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, "source " + info_.type);
  const std::string bridge = parameters.choice("bridge", {"a", "b", "nominal"}, "a");
  const int bits = std::stoi(parameters.choice("bits", {"10", "16", "24"}, "16"));
  const double noise = parameters.number("noise", 0.0, 10.0, 0.5e-3);
  seed_ = static_cast<std::uint64_t>(parameters.integer("seed", 0, 2147483647, 1));
  rate_ = parameters.number("rate", 0.1, 1e6, 5000.0);
  block_size_ = static_cast<std::size_t>(
      parameters.integer("block_size", 1, static_cast<int>(kBlockCapacity), 25));
  const auto load = parameters.numbers("load", std::vector<double>(6, 0.0));
  const auto amplitude = parameters.numbers("amplitude", std::vector<double>(6, 0.0));
  frequency_ = parameters.number("frequency", 0.0, 1e6, 1.0);
  samples_ = static_cast<std::uint64_t>(parameters.integer("samples", 0, 2147483647, 0));
  paced_ = parameters.choice("pace", {"original", "fast"}, "original") == "original";
  parameters.refuseUnknown();
  for (std::size_t k = 0; k < 6; ++k) {
    load_[static_cast<int>(k)] = std::clamp(load[k], -kLargestLoad, kLargestLoad);
    amplitude_[static_cast<int>(k)] = std::clamp(amplitude[k], -kLargestLoad, kLargestLoad);
  }
  bridge_ = bridge == "b" ? bridgeB(bits, noise) : bridgeA(bits, noise);
  if (bridge == "nominal") {
    bridge_ = nominalBridge();
    bridge_.bits = bits;
    bridge_.noise = noise;
  }
  strain_matrix_ = strainMatrix(bridge_);
  info_.device = "bridge " + bridge + ", seed " + std::to_string(seed_);
  info_.rate = rate_;
  info_.bits = bits;
  info_.full_scale = bridge_.full_scale;
  info_.paced = paced_;
}

void SimulatedSource::doOpen() {
  normal_ = NormalSource(seed_);
  first_ += position_;
  position_ = 0;
  ++stream_;
  start_ = Clock::now();
}

ReadResult SimulatedSource::doRead(SourceBlock& block, Clock::time_point deadline) {
  if (samples_ > 0 && position_ == samples_) return ReadResult::kEnd;
  std::size_t size = block_size_;
  if (samples_ > 0) size = std::min<std::uint64_t>(size, samples_ - position_);

  // a block is due with its last sample
  const double last = static_cast<double>(position_ + size - 1) / rate_;
  const Clock::time_point due = paced_ ? start_ + nanoseconds(last) : Clock::now();
  if (paced_) {
    const Wait waited = wait(-1, std::min(due, deadline));
    if (waited == Wait::kStopped) return ReadResult::kClosed;
    if (Clock::now() < due) return ReadResult::kTimeout;
  }

  for (std::size_t i = 0; i < size; ++i) {
    const double t = static_cast<double>(position_ + i) / rate_;
    const Vector6 w = load_ + amplitude_ * std::sin(2.0 * M_PI * frequency_ * t);
    const StrainSample sample = convert(bridge_, strain_matrix_, w, normal_);
    std::copy(sample.volts.begin(), sample.volts.end(), block.values.begin() + 6 * i);
    block.saturated[i] = sample.saturated;
  }
  block.count = size;
  block.sequence = first_ + position_;
  block.stream = stream_;
  block.period = 1.0 / rate_;
  block.device_time = static_cast<double>(position_) / rate_;
  block.temperature = bridge_.temperature;
  block.received = receptionAt(due);
  position_ += size;
  counts_.samples += size;
  return ReadResult::kSamples;
}

}  // namespace assembly_cell
