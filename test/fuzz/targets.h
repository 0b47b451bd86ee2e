// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>

namespace assembly_cell {

/// What is fuzzed: each takes any bytes, and aborts when a decoder breaks its word. Built into
/// libFuzzer programs (fuzz.cpp) and into the test that replays their corpora.
void fuzzRdtRecord(const std::uint8_t* data, std::size_t size);
void fuzzNetftConfiguration(const std::uint8_t* data, std::size_t size);
void fuzzBotaFrames(const std::uint8_t* data, std::size_t size);
void fuzzRobotiqFrames(const std::uint8_t* data, std::size_t size);
void fuzzReplay(const std::uint8_t* data, std::size_t size);
void fuzzIioText(const std::uint8_t* data, std::size_t size);
void fuzzMessageCheck(const std::uint8_t* data, std::size_t size);
void fuzzPlantGuard(const std::uint8_t* data, std::size_t size);

}  // namespace assembly_cell
