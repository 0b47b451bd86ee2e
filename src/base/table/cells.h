// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/table.h"

namespace assembly_cell::table {

/// The character between the cells of a row: semicolon, tab, comma or blank.
char separatorOf(const std::string& row);

/// Cells without blanks and quotes around them. A separator within quotes is none.
std::vector<std::string> cellsOf(const std::string& row, char separator);

enum class Decimal { kUnknown, kPoint, kComma };

/// A finite number; decimal: the mark of the file, set by the first number that has one. False for
/// anything else, and for a number with the other mark.
bool parseCell(const std::string& cell, Decimal& decimal, double& value);

/// Only digits and a sign.
bool isWhole(const std::string& cell);

/// A row of names: its first cell with text begins with a letter, or it counts the columns after an
/// empty cell (pandas without names).
bool isHeader(const std::vector<std::string>& cells);

struct HeaderCell {
  std::string name, unit;
};

/// Name as columnName(), and the unit: in brackets, or after an underscore of a known name.
HeaderCell headerCell(const std::string& cell);

/// A unit with or without brackets, or a mark for none.
bool isUnit(const std::string& cell);

/// SI units in one of `unit`; 0 for one that isn't of the quantity.
double factorOf(Quantity quantity, const std::string& unit);

/// Seconds in one of `unit`; 0 for no unit of time.
double secondsOf(const std::string& unit);

}  // namespace assembly_cell::table
