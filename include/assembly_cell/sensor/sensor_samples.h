// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

namespace assembly_cell {

/// Samples of one sensor: 6 × count values, a byte a sample with a bit for each channel at its
/// limit. A view: nothing is owned.
struct SensorSamples {
  const double* values = nullptr;
  const std::uint8_t* saturated = nullptr;  ///< null: none was
  std::size_t count = 0;

  /// A bit for each channel, over all samples.
  std::uint8_t saturatedChannels() const {
    unsigned channels = 0;
    for (std::size_t i = 0; saturated != nullptr && i < count; ++i) channels |= saturated[i];
    return static_cast<std::uint8_t>(channels);
  }
};

/// A block of samples without a gap as a bridge delivers it: strain [V], or wrenches of a device
/// that has its calibration in itself. A view.
struct BridgeBlock {
  SensorSamples samples;
  double start = 0.0;   ///< of the first sample [s]
  double period = 0.0;  ///< [s]
  std::uint32_t sequence = 0;
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< [°C]; NaN: unknown

  double end() const { return start + static_cast<double>(samples.count - 1) * period; }
};

}  // namespace assembly_cell
