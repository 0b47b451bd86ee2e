// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

namespace assembly_cell {

inline void putBig16(std::uint8_t* to, std::uint16_t value) {
  to[0] = static_cast<std::uint8_t>(value >> 8);
  to[1] = static_cast<std::uint8_t>(value & 0xff);
}

inline void putBig32(std::uint8_t* to, std::uint32_t value) {
  putBig16(to, static_cast<std::uint16_t>(value >> 16));
  putBig16(to + 2, static_cast<std::uint16_t>(value & 0xffff));
}

inline std::uint16_t big16(const std::uint8_t* from) {
  return static_cast<std::uint16_t>(from[0] << 8 | from[1]);
}

inline std::uint32_t big32(const std::uint8_t* from) {
  return static_cast<std::uint32_t>(big16(from)) << 16 | big16(from + 2);
}

inline void putLittle16(std::uint8_t* to, std::uint16_t value) {
  to[0] = static_cast<std::uint8_t>(value & 0xff);
  to[1] = static_cast<std::uint8_t>(value >> 8);
}

inline void putLittle32(std::uint8_t* to, std::uint32_t value) {
  putLittle16(to, static_cast<std::uint16_t>(value & 0xffff));
  putLittle16(to + 2, static_cast<std::uint16_t>(value >> 16));
}

inline std::uint16_t little16(const std::uint8_t* from) {
  return static_cast<std::uint16_t>(from[1] << 8 | from[0]);
}

inline std::uint32_t little32(const std::uint8_t* from) {
  return static_cast<std::uint32_t>(little16(from + 2)) << 16 | little16(from);
}

}  // namespace assembly_cell
