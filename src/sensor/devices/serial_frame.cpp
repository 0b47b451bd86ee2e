// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/serial_frame.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "byte_order.h"
#include "status_bits.h"

namespace assembly_cell {

namespace {

std::uint16_t reflectedCrc(const std::uint8_t* data, std::size_t size, unsigned polynomial) {
  unsigned crc = 0xffff;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= data[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? polynomial : 0u);
  }
  return static_cast<std::uint16_t>(crc);
}

double littleFloat(const std::uint8_t* from) {
  const std::uint32_t bits = little32(from);
  float value = 0.0f;
  std::memcpy(&value, &bits, sizeof value);
  return static_cast<double>(value);
}

constexpr std::array<StatusBit, 4> kBotaBits = {
    {{kBotaOverrun, "its program took too long (overrun)"},
     {kBotaOverrange, "overrange"},
     {kBotaInvalid, "invalid measurements"},
     {kBotaRaw, "raw measurements: set the sensor to calibrated wrenches"}}};

bool botaIntact(const std::uint8_t* frame) { return crcX25(frame + 1, 34) == little16(frame + 35); }

bool botaDecode(const std::uint8_t* frame, SerialFrame& decoded) {
  decoded.status = little16(frame + 1);
  decoded.usable = (decoded.status & (kBotaInvalid | kBotaRaw)) == 0;
  // it doesn't say which channel
  decoded.saturated = (decoded.status & kBotaOverrange) != 0 ? 0x3f : 0;
  bool finite = true;
  for (std::size_t k = 0; k < 6; ++k) {
    decoded.values[k] = littleFloat(frame + 3 + 4 * k);
    finite = finite && std::isfinite(decoded.values[k]);
  }
  decoded.timestamp = little32(frame + 27);
  decoded.temperature = littleFloat(frame + 31);
  if (!std::isfinite(decoded.temperature)) {
    decoded.temperature = std::numeric_limits<double>::quiet_NaN();
  }
  return finite;
}

bool robotiqIntact(const std::uint8_t* frame) {
  return crcModbus(frame, 14) == little16(frame + 14);
}

bool robotiqDecode(const std::uint8_t* frame, SerialFrame& decoded) {
  for (std::size_t k = 0; k < 6; ++k) {
    const auto counts = static_cast<std::int16_t>(little16(frame + 2 + 2 * k));
    decoded.values[k] = (k < 3 ? kRobotiqForce : kRobotiqTorque) * counts;
    if (counts == 32767 || counts == -32768) {
      decoded.saturated = static_cast<std::uint8_t>(decoded.saturated | 1u << k);
    }
  }
  return true;
}

}  // namespace

std::string botaStatusText(std::uint32_t status) {
  return statusText(status, kBotaBits.data(), kBotaBits.size());
}

const FrameFormat kBotaFormat = {"bota", kBotaSize, 1, {0xaa, 0}, true, botaIntact, botaDecode};
const FrameFormat kRobotiqFormat = {"robotiq",     kRobotiqSize, 2, {0x20, 0x4e}, false,
                                    robotiqIntact, robotiqDecode};

std::uint16_t crcX25(const std::uint8_t* data, std::size_t size) {
  return static_cast<std::uint16_t>(reflectedCrc(data, size, 0x8408) ^ 0xffff);
}

std::uint16_t crcModbus(const std::uint8_t* data, std::size_t size) {
  return reflectedCrc(data, size, 0xa001);
}

bool FrameDecoder::headerAt(std::size_t position) const {
  return std::equal(format_->header.begin(),
                    format_->header.begin() + static_cast<std::ptrdiff_t>(format_->header_size),
                    buffer_.begin() + static_cast<std::ptrdiff_t>(position));
}

bool FrameDecoder::next(SerialFrame& frame, SourceCounters& counters) {
  while (true) {
    const std::size_t left = end_ - begin_;
    const std::size_t needed = format_->size + (in_step_ ? 0 : format_->header_size);
    if (left < format_->header_size || (headerAt(begin_) && left < needed)) break;
    const std::uint8_t* start = buffer_.data() + begin_;
    if (headerAt(begin_)) {
      const bool intact = format_->intact(start);
      if (intact && (in_step_ || headerAt(begin_ + format_->size))) {
        frame = SerialFrame();
        const bool finite = format_->decode(start, frame);
        frame.skipped = skipped_;
        begin_ += format_->size;
        in_step_ = started_ = true;
        if (!finite) {
          ++counters.malformed;
          skipped_ += format_->size;
          continue;
        }
        skipped_ = 0;
        return true;
      }
      if (in_step_) ++counters.crc_errors;
    }
    // out of step: try every byte
    in_step_ = false;
    ++begin_;
    ++skipped_;
    if (started_) ++counters.garbage;
  }

  // space for the next bytes
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
            buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
  end_ -= begin_;
  begin_ = 0;
  return false;
}

void FrameDecoder::reset() {
  begin_ = end_ = skipped_ = 0;
  in_step_ = started_ = false;
}

}  // namespace assembly_cell
