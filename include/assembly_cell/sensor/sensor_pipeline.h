// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/frozen_readings.h"
#include "assembly_cell/sensor/sensor_samples.h"
#include "assembly_cell/sensor/stream_statistics.h"

namespace assembly_cell {

/// A mean of new samples that is being taken, for a bias.
struct ZeroMeasurement {
  bool active = false;
  bool armed = false;   ///< after the first block, which may have begun before the request
  Moments moments;      ///< of wrenches before the bias is subtracted
  std::string failure;  ///< why it can't succeed; empty: nothing yet
};

/// From a block of strain to wrenches and displacements of one sensor: the first stage between a
/// bridge and a strategy, which the driver runs; the second one is
/// align/estimation/block_pipeline.h. Wrench: exerted by the environment on the part that the
/// sensor carries, about the origin of the sensor frame, less the bias.
class SensorPipeline {
 public:
  enum class Result {
    kDone,
    kDuplicate,  ///< nothing was processed
    kNotFinite,  ///< the wrenches overflow and must not be used
  };

  /// Drops measurements of the previous calibration: bias, averages, noise, a zero in progress.
  void setCalibration(const Calibration& calibration);
  /// The sensor reports its own serial number.
  void setSerialNumber(const std::string& number) { calibration_.serial_number = number; }
  const Calibration& calibration() const { return calibration_; }

  void setBias(const Vector6& bias) { bias_ = bias; }
  const Vector6& bias() const { return bias_; }

  /// wrenches: 6 × count, each component within the range of messages; saturated: as the block's,
  /// with all channels where a wrench had to be cut. Resized; no other allocation.
  Result process(const BridgeBlock& block, std::vector<double>& wrenches,
                 std::vector<std::uint8_t>& saturated);
  /// Displacements of the block's samples, 6 × count, within the range of messages.
  void displacements(const SensorSamples& strain, std::vector<double>& out) const;

  /// Means of wrench (bias not subtracted) and strain since the average before.
  struct Average {
    Vector6 wrench, volts;
  };
  /// An average each `interval` [s], at ends of blocks. end: of the last block [s].
  std::optional<Average> takeAverage(double end, double interval, double period);

  /// The device has restarted, or its samples have a gap.
  void onDeviceRestart(bool recorded);

  ZeroMeasurement& zero() { return zero_; }
  StreamStatistics& statistics() { return statistics_; }
  /// Detects frozen samples among those that come in; a zero in progress then fails.
  FrozenReadings& frozen() { return frozen_; }

 private:
  void clearAverage();
  void updateZero(const BridgeBlock& block, Arrival arrival);

  Calibration calibration_;
  Vector6 bias_ = Vector6::Zero();
  ZeroMeasurement zero_;
  StreamStatistics statistics_;
  FrozenReadings frozen_;
  Average sum_{Vector6::Zero(), Vector6::Zero()};
  std::size_t summed_ = 0;
  double averaged_ = -1.0;  // end of the last average [s], −1: none
};

}  // namespace assembly_cell
