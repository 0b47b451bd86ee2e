// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/csv_text.h"

namespace assembly_cell {

std::string_view trimmed(std::string_view text, std::string_view blanks) {
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::vector<std::string_view> csvCells(std::string_view line, std::string_view blanks) {
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma), blanks));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::string csvCell(std::string text) {
  for (char& c : text) {
    if (c == ',') c = ';';
    if (static_cast<unsigned char>(c) < 0x20 || c == '"' || c == 0x7f) c = ' ';
  }
  return text;
}

}  // namespace assembly_cell
