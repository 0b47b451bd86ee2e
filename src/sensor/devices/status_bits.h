// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

/// A bit of a device's status word and its name.
struct StatusBit {
  std::uint32_t mask;
  const char* name;
};

/// Names of the bits that are set, then the word: "overrange, 0x00000002"; bits without a name are
/// in the word alone.
inline std::string statusText(std::uint32_t status, const StatusBit* bits, std::size_t count) {
  std::string names;
  for (std::size_t i = 0; i < count; ++i) {
    if ((status & bits[i].mask) != 0) names += bits[i].name + std::string(", ");
  }
  return names + text("0x%08x", status);
}

}  // namespace assembly_cell
