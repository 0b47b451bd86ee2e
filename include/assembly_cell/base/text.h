// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell {

/// printf into a string; the compiler checks the arguments.
[[gnu::format(printf, 1, 2)]] std::string text(const char* format, ...);

/// "crc32:" and eight digits, of all bytes.
std::string crcText(const std::string& bytes);

/// Without control characters.
bool isLine(const std::string& text);

/// `text` on one line: controls become blanks, bytes beyond ASCII question marks, more than
/// `longest` characters are cut off. For texts of devices and files.
std::string printable(const std::string& text, std::size_t longest = 80);

}  // namespace assembly_cell
