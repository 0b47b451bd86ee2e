// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/iio_text.h"

#include <charconv>
#include <cmath>

#include "assembly_cell/base/csv_text.h"

namespace assembly_cell {

namespace {

template <typename Number>
bool parseWhole(std::string_view text, Number& value) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && error == std::errc() && end == text.data() + text.size();
}

// takes a prefix off
bool take(std::string_view& text, std::string_view prefix) {
  if (text.substr(0, prefix.size()) != prefix) return false;
  text.remove_prefix(prefix.size());
  return true;
}

bool takeUnsigned(std::string_view& text, unsigned& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

}  // namespace

bool parseIioNumber(std::string_view text, double& value) {
  if (text.size() > kLongestIioText) return false;
  text = trimmed(text, " \t\r\n");
  if (text.size() > 3 && text.substr(text.size() - 3) == " dB") text.remove_suffix(3);
  double read = 0.0;
  if (!parseWhole(text, read) || !std::isfinite(read)) return false;
  value = read;
  return true;
}

bool parseIioInteger(std::string_view text, std::int64_t& value) {
  return text.size() <= kLongestIioText && parseWhole(trimmed(text, " \t\r\n"), value);
}

bool parseIioType(std::string_view text, IioType& type) {
  if (text.size() > kLongestIioText) return false;
  text = trimmed(text, " \t\r\n");
  IioType read;
  read.big_endian = take(text, "be:");
  if (!read.big_endian && !take(text, "le:")) return false;
  read.is_signed = take(text, "s");
  if (!read.is_signed && !take(text, "u")) return false;
  if (!takeUnsigned(text, read.bits) || !take(text, "/") || !takeUnsigned(text, read.storage) ||
      !take(text, ">>") || !takeUnsigned(text, read.shift) || !text.empty()) {
    return false;
  }
  const unsigned s = read.storage;
  if (s != 8 && s != 16 && s != 32 && s != 64) return false;
  if (read.bits == 0 || read.bits > s || read.shift > s - read.bits) return false;
  type = read;
  return true;
}

bool isIioEndCode(std::int64_t code, const IioType& type) {
  if (type.bits == 0 || type.bits > 62) return false;
  const std::int64_t span = std::int64_t{1} << type.bits;
  const std::int64_t low = type.is_signed ? -span / 2 : 0;
  return code <= low || code >= low + span - 1;
}

}  // namespace assembly_cell
