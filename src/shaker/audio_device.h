// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace assembly_cell {

/// A sound card's output by its ALSA name, 16 bits, interleaved.
class AudioDevice {
 public:
  struct Settings {
    std::string device;
    unsigned rate = 48000;  ///< [Hz], exactly
    unsigned channels = 2;
    double buffer = 0.1;  ///< the card's, at least [s]
  };
  /// Throws InputError with ALSA's reason.
  explicit AudioDevice(const Settings& settings);
  ~AudioDevice();

  /// False for ALSA's null and file devices, which accept samples at any rate.
  bool hasRate() const { return has_rate_; }
  /// Queued samples; 0 after a gap.
  double queued();
  /// Samples of all channels that may be written now.
  std::size_t available();
  /// frames: channels × n. Throws InputError when the device is lost.
  void write(const std::vector<std::int16_t>& frames);
  std::uint64_t gaps() const { return gaps_; }

 private:
  void recover(long code, const char* what);

  struct Handle;
  std::unique_ptr<Handle> handle_;
  Settings settings_;
  bool has_rate_ = true;
  std::uint64_t gaps_ = 0;
};

}  // namespace assembly_cell
