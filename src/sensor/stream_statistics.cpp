// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/stream_statistics.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kNoiseSamples = 50;  // differences in one estimate of the noise

}  // namespace

StreamStatistics::Begin StreamStatistics::begin(const BridgeBlock& block) {
  const Arrival arrival = sequence_.accept(block.sequence);
  if (arrival == Arrival::kDuplicate) return {arrival, false};
  report_.temperature = block.temperature;
  if (arrival != Arrival::kNext) noise_.breakRun();
  // the rate is measured on the time base of the samples
  const bool restarted =
      arrival == Arrival::kRestart || !rate_started_ || block.start <= last_time_;
  if (restarted) {
    rate_started_ = true;
    rate_from_ = block.start;
    rate_samples_ = block.samples.count - 1;
  } else {
    rate_samples_ += block.samples.count;
  }
  last_time_ = block.end();
  return {arrival, restarted};
}

void StreamStatistics::addSample(const Vector6& wrench, std::uint8_t saturated) {
  noise_.add(wrench);
  ++report_.total_samples;
  if (saturated != 0) ++report_.total_saturated;
  report_.saturated = static_cast<std::uint8_t>(report_.saturated | saturated);
}

void StreamStatistics::addMalformed(std::uint32_t sequence, const std::string& fault) {
  report_.malformed = true;
  ++report_.total_malformed;
  report_.fault = "block " + std::to_string(sequence) + ": " + fault;
}

void StreamStatistics::clearNoise() {
  restartNoise();
  report_.noise_samples = 0;
}

void StreamStatistics::measure() {
  if (rate_samples_ > 0 && last_time_ > rate_from_) {
    report_.rate = static_cast<double>(rate_samples_) / (last_time_ - rate_from_);
    rate_from_ = last_time_;
    rate_samples_ = 0;
  }
  // the first estimate grows with its samples; then each one is complete
  if (noise_.count() >= kNoiseSamples || noise_.count() > report_.noise_samples) {
    report_.noise_rms = noise_.rms();
    report_.noise_samples = noise_.count();
    if (report_.noise_samples >= kNoiseSamples) noise_.clear();
  }
}

StreamReport StreamStatistics::report() {
  measure();
  StreamReport out = report_;
  out.lost = sequence_.lost() - report_.total_lost;
  out.duplicates = sequence_.duplicates() - report_.total_duplicates;
  out.restarts = sequence_.restarts() - report_.total_restarts;
  out.total_lost = report_.total_lost = sequence_.lost();
  out.total_duplicates = report_.total_duplicates = sequence_.duplicates();
  out.total_restarts = report_.total_restarts = sequence_.restarts();
  report_.saturated = 0;
  report_.malformed = false;
  report_.outside = 0;
  return out;
}

}  // namespace assembly_cell
