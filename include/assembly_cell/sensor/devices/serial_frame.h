// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// Frames of serial six-axis sensors: byte layouts, and a decoder that finds them in a stream of
/// bytes. No devices.

/// Content of a frame.
struct SerialFrame {
  std::array<double, 6> values{};  ///< fx fy fz [N] tx ty tz [N·m]
  std::uint32_t status = 0;        ///< the device's own bits
  bool usable = true;              ///< false: by its status the values are no wrench
  std::uint8_t saturated = 0;      ///< bit k: channel k
  std::uint32_t timestamp = 0;     ///< the device's ticks, if the format has any
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< [°C]
  std::size_t skipped = 0;  ///< bytes between the frame before and this one
};

/// CRC-16/X-25: polynomial 0x1021 reflected, start and final xor 0xffff.
std::uint16_t crcX25(const std::uint8_t* data, std::size_t size);
/// CRC-16/Modbus: polynomial 0x8005 reflected (0xa001), start 0xffff.
std::uint16_t crcModbus(const std::uint8_t* data, std::size_t size);

/// A format of frames of one size that begin with a fixed header.
struct FrameFormat {
  const char* name;
  std::size_t size;         ///< [bytes]
  std::size_t header_size;  ///< 1 or 2
  std::array<std::uint8_t, 2> header;
  bool has_timestamp;
  bool (*intact)(const std::uint8_t* frame);                        ///< its CRC is right
  bool (*decode)(const std::uint8_t* frame, SerialFrame& decoded);  ///< false: a value isn't finite
};

/// Bota SensONE and Rokubi, little-endian, 37 bytes: 0xAA, status u16 (1: overrun, 2: overrange, 4:
/// invalid, 8: raw), 6 float32, timestamp u32 [µs], temperature float32, CRC-16/X-25 of the 34
/// between.
extern const FrameFormat kBotaFormat;
constexpr std::size_t kBotaSize = 37;
/// Bits of a status word by name, in one line.
std::string botaStatusText(std::uint32_t status);
constexpr std::uint16_t kBotaOverrun = 1, kBotaOverrange = 2, kBotaInvalid = 4, kBotaRaw = 8;

/// Robotiq FT 300 in stream mode, little-endian, 16 bytes: 0x20 0x4E, 6 int16 (0.01 N, 0.001 N·m),
/// CRC-16/Modbus of the 14 before.
extern const FrameFormat kRobotiqFormat;
constexpr std::size_t kRobotiqSize = 16;
constexpr double kRobotiqForce = 0.01;    ///< [N] per count
constexpr double kRobotiqTorque = 0.001;  ///< [N·m] per count

/// Finds frames in bytes as they come. In step, a frame is one with the right header and CRC where
/// the last one ended. Out of step (at the start, after anything else) the header of the next frame
/// must follow too: a CRC of 16 bits alone would let one false header in 65 536 through.
class FrameDecoder {
 public:
  explicit FrameDecoder(const FrameFormat& format) : format_(&format) {}

  /// Space for the next bytes; at least one.
  std::uint8_t* space() { return buffer_.data() + end_; }
  std::size_t freeBytes() const { return buffer_.size() - end_; }
  /// `size` bytes were put at space().
  void added(std::size_t size) { end_ += size; }

  /// The next frame; false: more bytes are needed. Counts crc_errors (frames in step whose CRC is
  /// wrong), malformed, and garbage: bytes passed over once a first frame has come.
  bool next(SerialFrame& frame, SourceCounters& counters);

  void reset();

 private:
  bool headerAt(std::size_t position) const;

  const FrameFormat* format_;
  std::array<std::uint8_t, 4096> buffer_{};
  std::size_t begin_ = 0, end_ = 0;  // of the bytes not yet decoded
  bool in_step_ = false;
  bool started_ = false;     // a frame has come
  std::size_t skipped_ = 0;  // since the last frame
};

}  // namespace assembly_cell
