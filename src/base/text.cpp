// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/text.h"

#include <algorithm>
#include <boost/crc.hpp>
#include <cstdarg>
#include <cstdio>

namespace assembly_cell {

std::string text(const char* format, ...) {
  std::va_list values, again;
  va_start(values, format);
  va_copy(again, values);
  const int size = std::vsnprintf(nullptr, 0, format, values);
  va_end(values);
  std::string out(size > 0 ? static_cast<std::size_t>(size) : 0, '\0');
  std::vsnprintf(out.data(), out.size() + 1, format, again);
  va_end(again);
  return out;
}

std::string crcText(const std::string& bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return text("crc32:%08x", static_cast<unsigned>(crc.checksum()));
}

bool isLine(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
}

std::string printable(const std::string& text, std::size_t longest) {
  std::string line = text.substr(0, longest);
  for (char& c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      c = ' ';
    } else if (byte > 0x7f) {
      c = '?';
    }
  }
  return text.size() > longest ? line + "..." : line;
}

}  // namespace assembly_cell
