// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/block_decoder.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell::ros_bridge {

namespace {

// Of a channel at its limit [s]. A press ends at the third such block and takes the load off within
// 0.3 s: no strategy saturates a sensor for this long.
constexpr double kSaturated = 0.5;
constexpr int kMinSaturated = 5;  // blocks: a freeze between two of them doesn't count

// Of 6 × n numbers, sample after sample. False if it isn't a block of finite numbers.
bool moments(const std::vector<double>& samples, BlockMoments& out) {
  const std::size_t n = samples.size() / 6;
  if (n == 0 || samples.size() != 6 * n) return false;
  out = momentsOf(samples.data(), n);
  return out.mean.allFinite() && out.covariance.allFinite();
}

// A bit for each channel that is at its limit in one of the samples.
std::uint8_t saturatedChannels(const WrenchSamples& message) {
  return std::accumulate(
      message.saturated.begin(), message.saturated.end(), std::uint8_t{0},
      [](std::uint8_t all, std::uint8_t bits) -> std::uint8_t { return all | bits; });
}

}  // namespace

std::optional<std::string> SaturationCheck::add(const StreamBlock& block, std::size_t sensor) {
  Run& run = runs_[sensor];
  if (block.saturated[sensor] == 0) {
    run = {};
    return std::nullopt;
  }
  if (run.blocks++ == 0) run.since = block.end;
  run.channels = static_cast<std::uint8_t>(run.channels | block.saturated[sensor]);
  const double time = (block.end - run.since).toSec();
  if (run.blocks < kMinSaturated || time < kSaturated) return std::nullopt;
  return text("channels %s at their limit in every block for %.2g s",
              channelText(run.channels).c_str(), time);
}

BlockDecoder::BlockDecoder(ros::NodeHandle& nh, double converter_step, PlantMonitor& monitor) {
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    Sensor& sensor = sensors_[i];
    sensor.calibration_sub = subscribeChecked<SensorCalibration>(
        nh, i == 0 ? "sensor_a/calibration" : "sensor_b/calibration", 1,
        [&sensor, &monitor, converter_step](const SensorCalibration::ConstPtr& message) {
          using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
          const Matrix6 S = Eigen::Map<const RowMajor>(message->volts_to_wrench.data());
          const PlantMonitor::Lock lock = monitor.lock();
          sensor.rounding = roundingCovariance(S, converter_step);
          sensor.serial_number = message->serial_number;
          monitor.notify();
        });
  }
}

bool BlockDecoder::hasCalibrations() const {
  return sensors_[0].rounding.has_value() && sensors_[1].rounding.has_value();
}

void BlockDecoder::checkCalibrations() const {
  const std::string& serial = sensors_[0].serial_number;
  if (serial != sensors_[1].serial_number || serial == kUnknownSerial) return;
  throw PlantError(AlignFailure::kStopped,
                   "sensor_a and sensor_b both have a calibration of '" + serial +
                       "': give each the one of its own serial number (cell.launch "
                       "calibration_a:=, calibration_b:=)");
}

std::optional<StreamBlock> BlockDecoder::decode(const BlockMessages& messages) const {
  const WrenchSamples &wrench_a = *messages.wrench[kWrenchA],
                      &wrench_b = *messages.wrench[kWrenchB];
  BlockMoments a, b, d;
  if (!moments(wrench_a.wrench, a) || !moments(wrench_b.wrench, b) ||
      !moments(messages.displacement->displacement, d)) {
    return std::nullopt;
  }
  StreamBlock out;
  out.sequence = messages.sequence;
  out.end = messages.carrier->header.stamp;
  try {
    out.X_BC = fromPose(messages.carrier->pose, "carrier_pose");
  } catch (const InputError&) {
    return std::nullopt;
  }
  out.saturated = {saturatedChannels(wrench_a), saturatedChannels(wrench_b)};
  PlantBlock& means = out.means;
  means.wrench_a = a.mean;
  means.wrench_b = b.mean;
  means.displacement_b = compliance_ ? Vector6(*compliance_ * b.mean) : d.mean;
  means.covariance_a = a.covariance;
  means.covariance_b = b.covariance;
  means.rounding_a = sensors_[0].rounding.value_or(Matrix6::Zero());
  means.rounding_b = sensors_[1].rounding.value_or(Matrix6::Zero());
  means.samples = std::min(a.count, b.count);
  means.length = b.count * wrench_b.period;
  means.saturated = out.saturated[0] != 0 || out.saturated[1] != 0;
  means.carrier = restFromPose(out.X_BC);
  return out;
}

}  // namespace assembly_cell::ros_bridge
