// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/block_decoder.h"

#include <algorithm>
#include <vector>

#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell::ros_bridge {

namespace {

// Longest time of a channel at its limit [s]. A press ends at the third such block and takes the
// load off within 0.3 s: no strategy saturates a sensor for this long.
constexpr double kSaturated = 0.5;
constexpr int kMinSaturated = 5;  // blocks: a freeze between two of them doesn't count

SensorSamples view(const std::vector<double>& values,
                   const std::vector<std::uint8_t>* saturated = nullptr) {
  const bool marked = saturated != nullptr && !saturated->empty();
  return {values.data(), marked ? saturated->data() : nullptr, values.size() / 6};
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

BlockDecoder::BlockDecoder(ros::NodeHandle& nh, double converter_step, Sensors sensors,
                           PlantMonitor& monitor)
    : sensors_(sensors), pipeline_(converter_step, sensors) {
  for (std::size_t i = firstSensor(sensors); i < calibration_subs_.size(); ++i) {
    calibration_subs_[i] = subscribeChecked<SensorCalibration>(
        nh, i == 0 ? "sensor_a/calibration" : "sensor_b/calibration", 1,
        [this, i, &monitor](const SensorCalibration::ConstPtr& message) {
          using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
          Calibration calibration;
          calibration.volts_to_wrench = Eigen::Map<const RowMajor>(message->volts_to_wrench.data());
          calibration.serial_number = message->serial_number;
          const PlantMonitor::Lock lock = monitor.lock();
          pipeline_.setCalibration(i, calibration);
          monitor.notify();
        });
  }
}

void BlockDecoder::checkCalibrations() const {
  if (sensors_ == Sensors::kB) return;
  const std::string& serial = pipeline_.calibration(0)->serial_number;
  if (serial != pipeline_.calibration(1)->serial_number || serial == kUnknownSerial) return;
  throw PlantError(AlignFailure::kStopped,
                   "sensor_a and sensor_b both have a calibration of '" + serial +
                       "': give each the one of its own serial number (cell.launch "
                       "calibration_a:=, calibration_b:=)");
}

std::optional<StreamBlock> BlockDecoder::decode(const BlockMessages& messages) const {
  const WrenchSamples::ConstPtr& wrench_a = messages.wrench[kWrenchA];
  const WrenchSamples& wrench_b = *messages.wrench[kWrenchB];
  const SensorSamples a = wrench_a ? view(wrench_a->wrench, &wrench_a->saturated) : SensorSamples{};
  const SensorSamples b = view(wrench_b.wrench, &wrench_b.saturated);
  const std::optional<PlantBlock> means =
      pipeline_.fromWrenches(a, b, view(messages.displacement->displacement), wrench_b.period);
  if (!means) return std::nullopt;
  StreamBlock out;
  out.sequence = messages.sequence;
  out.end = messages.carrier->header.stamp;
  try {
    out.X_BC = fromPose(messages.carrier->pose, "carrier_pose");
  } catch (const InputError&) {
    return std::nullopt;
  }
  out.saturated = {a.saturatedChannels(), b.saturatedChannels()};
  out.means = *means;
  out.means.carrier = restFromPose(out.X_BC);
  return out;
}

}  // namespace assembly_cell::ros_bridge
