// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace assembly_cell {

/// `text` without the blanks at both ends.
std::string_view trimmed(std::string_view text, std::string_view blanks = " \t\r");

/// The cells of one CSV row, trimmed: one more than there are commas. Views into `line`.
std::vector<std::string_view> csvCells(std::string_view line, std::string_view blanks = " \t\r");

/// Free text as one cell of a row: commas become semicolons; quotes, ends of line and other control
/// characters become blanks.
std::string csvCell(std::string text);

}  // namespace assembly_cell
