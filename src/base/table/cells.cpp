// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "cells.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell::table {

namespace {

bool isDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

bool isLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

// whether blanks separate numbers with decimal commas, as in "0,5 1,25"
bool isBlankBetweenCommas(const std::string& row) {
  const std::vector<std::string> cells = cellsOf(row, ' ');
  const auto number = [](const std::string& cell) {
    Decimal decimal = Decimal::kComma;
    double value = 0.0;
    return parseCell(cell, decimal, value);
  };
  return cells.size() > 1 && std::all_of(cells.begin(), cells.end(), number);
}

bool isTabBesideComma(const std::string& row, std::size_t tab) {
  const std::size_t before = tab == 0 ? std::string::npos : row.find_last_not_of(" \t", tab - 1);
  const std::size_t after = row.find_first_not_of(" \t", tab);
  return (before != std::string::npos && row[before] == ',') ||
         (after != std::string::npos && row[after] == ',');
}

}  // namespace

char separatorOf(const std::string& row) {
  if (row.find(';') != std::string::npos) return ';';
  for (std::size_t tab = row.find('\t'); tab != std::string::npos; tab = row.find('\t', tab + 1)) {
    if (!isTabBesideComma(row, tab)) return '\t';
  }
  if (row.find(',') == std::string::npos) return ' ';
  return isBlankBetweenCommas(row) ? ' ' : ',';
}

std::vector<std::string> cellsOf(const std::string& row, char separator) {
  std::vector<std::string> cells;
  std::string cell;
  bool quoted = false;
  const auto finish = [&] {
    std::string_view content = trimmed(cell, " \t\r");
    if (separator != ' ' || !content.empty()) cells.emplace_back(trimmed(content, " \t\r\""));
    cell.clear();
  };
  for (const char c : row) {
    if (c == '"') quoted = !quoted;
    if (!quoted && (c == separator || (separator == ' ' && (c == '\t' || c == '\r')))) {
      finish();
    } else {
      cell += c;
    }
  }
  finish();
  return cells;
}

bool parseCell(const std::string& cell, Decimal& decimal, double& value) {
  const std::size_t comma = cell.find(',');
  const Decimal mark = comma != std::string::npos            ? Decimal::kComma
                       : cell.find('.') != std::string::npos ? Decimal::kPoint
                                                             : Decimal::kUnknown;
  if (mark != Decimal::kUnknown && decimal != Decimal::kUnknown && mark != decimal) return false;
  std::string number = cell;
  if (mark == Decimal::kComma) {
    // digits around it: "1,", "1,2,3" and "1,2.3" are none
    const bool digits = comma + 1 < cell.size() && comma > 0 && isDigit(cell[comma - 1]) &&
                        isDigit(cell[comma + 1]) && cell.find('.') == std::string::npos;
    if (!digits) return false;
    number[comma] = '.';
  }
  if (!parseNumber(number, value)) return false;
  if (mark != Decimal::kUnknown) decimal = mark;
  return true;
}

bool isWhole(const std::string& cell) {
  const std::size_t sign = !cell.empty() && (cell[0] == '-' || cell[0] == '+') ? 1 : 0;
  return cell.size() > sign &&
         std::all_of(cell.begin() + static_cast<std::ptrdiff_t>(sign), cell.end(), isDigit);
}

bool isHeader(const std::vector<std::string>& cells) {
  const auto text = std::find_if(cells.begin(), cells.end(),
                                 [](const std::string& cell) { return !cell.empty(); });
  if (text == cells.end()) return false;
  // the columns' numbers after the cell above an index
  bool counts = text == cells.begin() + 1 && cells.size() > 2;
  for (std::size_t c = 1; c < cells.size(); ++c) counts &= cells[c] == std::to_string(c - 1);
  if (counts) return true;
  // columns may have whole numbers for names, no others
  for (auto cell = cells.begin(); cell != cells.end(); ++cell) {
    double value = 0.0;
    Decimal decimal = Decimal::kUnknown;
    if (parseCell(*cell, decimal, value) && (cell == text || !isWhole(*cell))) return false;
  }
  std::string lower = *text;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const std::size_t word = lower.find_first_not_of("%_/[( ");
  return word != std::string::npos && isLetter(lower[word]) && lower != "nan" && lower != "inf" &&
         lower != "null";
}

}  // namespace assembly_cell::table
