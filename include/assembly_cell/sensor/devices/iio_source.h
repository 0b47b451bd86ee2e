// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/devices/iio_text.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// A converter of six bridge channels behind Linux Industrial I/O, polled through sysfs: volts =
/// (raw + offset)·scale/1000. Keys: iio_root, device (its folder or its name), channels (six, as in
/// in_<channel>_raw), rate [Hz] (of polling), block_period [s].
///
/// A poll that comes a period or more too late skips its numbers, which count as lost: so many
/// conversions were missed. sysfs has no record of duplicates or stale values.
class IioSource : public StrainSource {
 public:
  IioSource();
  ~IioSource() override { close(); }

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;
  void doClose() noexcept override;

 private:
  /// What is known of a channel.
  struct Channel {
    Descriptor raw;
    double offset = 0.0;  ///< codes
    double scale = 0.0;   ///< [V] per code
    IioType type;         ///< bits 0: unknown
  };

  std::string findDevice() const;
  Channel openChannel(const std::string& folder, const std::string& name) const;
  double readTemperature() const;
  enum class Poll { kSample, kMalformed, kGone };
  Poll poll(std::array<double, 6>& volts, std::uint8_t& saturated);

  // parameters
  std::string root_, device_;
  std::vector<std::string> channel_names_;
  double rate_ = 0.0;  // [Hz]
  std::chrono::nanoseconds block_period_{};

  std::array<Channel, 6> channels_;
  Descriptor temperature_;
  double temperature_scale_ = 1.0, temperature_offset_ = 0.0;
  std::uint64_t base_ = 0;  // sequence of tick 0
  std::uint64_t tick_ = 0;  // the next
  std::uint32_t stream_ = 0;
  Clock::time_point start_;
  std::string gone_;  // why
};

}  // namespace assembly_cell
