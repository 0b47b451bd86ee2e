// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/sensor_pipeline.h"

#include "assembly_cell/sensor/frozen_readings.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell {

namespace {

constexpr std::uint8_t kAllChannels = 0x3f;  // if the source doesn't report which one

using Sample = Eigen::Map<const Vector6>;

}  // namespace

void SensorPipeline::setCalibration(const Calibration& calibration) {
  calibration_ = calibration;
  bias_.setZero();
  statistics_.clearNoise();
  clearAverage();
  if (zero_.active) zero_.failure = "the calibration changed meanwhile: try again";
}

void SensorPipeline::clearAverage() {
  sum_ = {Vector6::Zero(), Vector6::Zero()};
  summed_ = 0;
}

SensorPipeline::Result SensorPipeline::process(const BridgeBlock& block,
                                               std::vector<double>& wrenches,
                                               std::vector<std::uint8_t>& saturated) {
  const StreamStatistics::Begin begin = statistics_.begin(block);
  if (begin.arrival == Arrival::kDuplicate) return Result::kDuplicate;
  if (begin.restarted) {
    clearAverage();
    averaged_ = -1.0;
  }
  const std::size_t n = block.samples.count;
  wrenches.resize(6 * n);
  saturated.assign(block.samples.saturated, block.samples.saturated + n);
  Average sum{Vector6::Zero(), Vector6::Zero()};
  for (std::size_t k = 0; k < n; ++k) {
    const Sample volts(block.samples.values + 6 * k);
    const Vector6 raw = wrenchFromVolts(calibration_, volts);
    const Vector6 wrench = cutWrench(raw - bias_);
    Vector6::Map(wrenches.data() + 6 * k) = wrench;
    if (saturated[k] == 0 && wrench != raw - bias_) saturated[k] = kAllChannels;
    sum.wrench += raw;
    sum.volts += volts;
    if (zero_.active && zero_.armed) zero_.moments.add(raw);
    statistics_.addSample(raw, saturated[k]);
    frozen_.add(volts.data(), block.period);
  }
  if (!sum.wrench.allFinite()) {
    statistics_.addMalformed(block.sequence, "wrench is not finite");
    statistics_.restartNoise();
    if (zero_.active) zero_.failure = "the wrench is not finite: look at the source";
    return Result::kNotFinite;
  }
  updateZero(block, begin.arrival);
  sum_.wrench += sum.wrench;
  sum_.volts += sum.volts;
  summed_ += n;
  return Result::kDone;
}

void SensorPipeline::updateZero(const BridgeBlock& block, Arrival arrival) {
  if (!zero_.active || !zero_.failure.empty()) return;
  if (arrival == Arrival::kRestart) zero_.failure = "the source restarted: try again";
  if (zero_.armed && frozen_.isFrozen()) zero_.failure = frozen_.describe() + kFrozenRemedy;
  const std::uint8_t saturated = block.samples.saturatedChannels();
  if (zero_.armed && saturated != 0) {
    zero_.failure = "channel " + channelText(saturated) + " saturated in block " +
                    std::to_string(block.sequence) + ": unload the sensor or look at its bridge";
  }
  zero_.armed = true;
}

void SensorPipeline::displacements(const SensorSamples& strain, std::vector<double>& out) const {
  out.resize(6 * strain.count);
  for (std::size_t k = 0; k < strain.count; ++k) {
    Vector6::Map(out.data() + 6 * k) =
        cutDisplacement(displacementFromVolts(calibration_, Sample(strain.values + 6 * k)));
  }
}

std::optional<SensorPipeline::Average> SensorPipeline::takeAverage(double end, double interval,
                                                                   double period) {
  // half a sample of slack: blocks as long as the interval all give one
  if (averaged_ >= 0.0 && end - averaged_ < interval - 0.5 * period) return std::nullopt;
  averaged_ = end;
  const auto n = static_cast<double>(summed_);
  const Average mean{sum_.wrench / n, sum_.volts / n};
  clearAverage();
  statistics_.addOutside(outsideWrenchRange(calibration_, mean.volts));
  return mean;
}

void SensorPipeline::onDeviceRestart(bool recorded) {
  statistics_.breakNoise();
  if (zero_.active && !recorded) zero_.failure = "the device restarted: try again";
}

}  // namespace assembly_cell
