// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace assembly_cell {

/// What the attributes of Linux Industrial I/O say (Documentation/ABI/testing/sysfs-bus-iio).

constexpr std::size_t kLongestIioText = 64;  ///< characters of a number

/// A finite number on one line, blanks around it and a unit dB behind it allowed; false for
/// anything else.
bool parseIioNumber(std::string_view text, double& value);
/// An integer on one line.
bool parseIioInteger(std::string_view text, std::int64_t& value);

/// Layout of a sample in a buffer: [be|le]:[s|u]bits/storage>>shift.
struct IioType {
  bool big_endian = false;
  bool is_signed = true;
  unsigned bits = 0;     ///< that count, 1 … storage
  unsigned storage = 0;  ///< 8, 16, 32 or 64
  unsigned shift = 0;    ///< bits below to drop
};

/// False for another notation, or one with repetition (X).
bool parseIioType(std::string_view text, IioType& type);

/// True at either end of the type's codes.
bool isIioEndCode(std::int64_t code, const IioType& type);

}  // namespace assembly_cell
