// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "device_codecs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "devices/byte_order.h"

namespace assembly_cell {

namespace {

void putLittleFloat(std::uint8_t* to, double number) {
  const float value = static_cast<float>(number);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  putLittle32(to, bits);
}

}  // namespace

std::array<std::uint8_t, kRdtRecordSize> packRdtRecord(const RdtRecord& record) {
  std::array<std::uint8_t, kRdtRecordSize> data;
  putBig32(&data[0], record.rdt_sequence);
  putBig32(&data[4], record.ft_sequence);
  putBig32(&data[8], record.status);
  for (std::size_t k = 0; k < 6; ++k) {
    putBig32(&data[12 + 4 * k], static_cast<std::uint32_t>(record.counts[k]));
  }
  return data;
}

bool unpackRdtRequest(const std::uint8_t* data, std::size_t size, RdtRequest& request) {
  if (size != kRdtRequestSize || big16(data) != kRdtHeader) return false;
  request = {big16(data + 2), big32(data + 4)};
  return true;
}

std::array<std::uint8_t, kBotaSize> packBotaFrame(const SerialFrame& frame) {
  std::array<std::uint8_t, kBotaSize> data;
  data[0] = kBotaFormat.header[0];
  putLittle16(&data[1], static_cast<std::uint16_t>(frame.status));
  for (std::size_t k = 0; k < 6; ++k) putLittleFloat(&data[3 + 4 * k], frame.values[k]);
  putLittle32(&data[27], frame.timestamp);
  putLittleFloat(&data[31], frame.temperature);
  putLittle16(&data[35], crcX25(&data[1], 34));
  return data;
}

std::array<std::uint8_t, kRobotiqSize> packRobotiqFrame(const SerialFrame& frame) {
  std::array<std::uint8_t, kRobotiqSize> data;
  data[0] = kRobotiqFormat.header[0];
  data[1] = kRobotiqFormat.header[1];
  for (std::size_t k = 0; k < 6; ++k) {
    const double counts =
        std::nearbyint(frame.values[k] / (k < 3 ? kRobotiqForce : kRobotiqTorque));
    const auto code = static_cast<std::int16_t>(std::clamp(counts, -32768.0, 32767.0));
    putLittle16(&data[2 + 2 * k], static_cast<std::uint16_t>(code));
  }
  putLittle16(&data[14], crcModbus(data.data(), 14));
  return data;
}

}  // namespace assembly_cell
