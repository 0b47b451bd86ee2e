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

  /// Whether samples are taken at a rate at all: ALSA's null and file devices take what they get.
  bool paced() const { return paced_; }
  /// Samples that wait to sound. After a gap the queue is empty.
  double queued();
  /// Samples of all channels that may be written now.
  std::size_t room();
  /// frames: channels × n. Throws InputError when the device is lost.
  void write(const std::vector<std::int16_t>& frames);
  std::uint64_t gaps() const { return gaps_; }

 private:
  void recover(long code, const char* what);

  struct Handle;
  std::unique_ptr<Handle> handle_;
  Settings settings_;
  bool paced_ = true;
  std::uint64_t gaps_ = 0;
};

}  // namespace assembly_cell
