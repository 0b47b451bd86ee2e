// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "assembly_cell/sensor/devices/rdt.h"
#include "assembly_cell/sensor/devices/serial_frame.h"

namespace assembly_cell {

// The devices' side of the protocols.

std::array<std::uint8_t, kRdtRecordSize> packRdtRecord(const RdtRecord& record);
/// False for a wrong size, or a wrong header.
bool unpackRdtRequest(const std::uint8_t* data, std::size_t size, RdtRequest& request);

std::array<std::uint8_t, kBotaSize> packBotaFrame(const SerialFrame& frame);
std::array<std::uint8_t, kRobotiqSize> packRobotiqFrame(const SerialFrame& frame);

}  // namespace assembly_cell
