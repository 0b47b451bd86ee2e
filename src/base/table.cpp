// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/table.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <sstream>
#include <string_view>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

// Counts of nanoseconds are 2e18; squares of squares of this are still finite.
constexpr double kLargest = 1e30;

char separatorOf(const std::string& row) {
  for (const char c : {',', ';', '\t'}) {
    if (row.find(c) != std::string::npos) return c;
  }
  return ' ';
}

// a separator at the end of a row makes no cell beyond the columns
std::vector<std::string> cellsOf(std::string row, char separator, std::size_t columns) {
  row = std::string(trimmed(row, " \r"));
  if (separator == ' ') {
    row.erase(
        std::unique(row.begin(), row.end(), [](char a, char b) { return a == ' ' && b == ' '; }),
        row.end());
  }
  if (separator != ',') std::replace(row.begin(), row.end(), separator, ',');
  auto cells = csvCells(row, " \t\r\"");
  if (!row.empty() && row.back() == ',' && cells.size() > columns) cells.pop_back();
  return {cells.begin(), cells.end()};
}

// words that are no number and don't stand for one
bool isHeader(const std::vector<std::string>& cells) {
  double value = 0.0;
  return !cells.empty() && !cells[0].empty() && !parseNumber(cells[0], value) &&
         std::isalpha(static_cast<unsigned char>(cells[0][0])) != 0 && cells[0] != "nan" &&
         cells[0] != "NaN" && cells[0] != "inf";
}

std::string lowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::vector<double> numbersOf(const Table& table, const std::vector<std::string>& cells,
                              const std::string& place, bool blanks) {
  if (cells.size() != table.names.size()) {
    throw InputError(place + std::to_string(cells.size()) + " columns: give " +
                     std::to_string(table.names.size()) + " as in the first row");
  }
  std::vector<double> row(cells.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (blanks && cells[c].empty()) continue;
    if (parseNumber(cells[c], row[c])) {
      if (std::abs(row[c]) <= kLargest) continue;
      throw InputError(place + "column " + table.names[c] + " is " + printable(cells[c]) +
                       ": nothing measured is beyond 1e30; correct it, or take the row out");
    }
    throw InputError(place + "column " + table.names[c] + " is '" + printable(cells[c]) +
                     "': give a finite number");
  }
  return row;
}

}  // namespace

bool isMisspelt(const std::string& word, const std::string& meant) {
  constexpr std::size_t kShortest = 5, kLong = 8;
  const auto letter = [](unsigned char c) { return std::isalpha(c) != 0; };
  if (meant.size() < kShortest || !std::all_of(meant.begin(), meant.end(), letter) ||
      word.find(meant) != std::string::npos) {
    return false;
  }
  // Levenshtein's distance, row by row
  std::vector<std::size_t> row(meant.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= word.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t k = 1; k <= meant.size(); ++k) {
      const std::size_t change = diagonal + (word[i - 1] == meant[k - 1] ? 0 : 1);
      diagonal = row[k];
      row[k] = std::min({row[k] + 1, row[k - 1] + 1, change});
    }
  }
  return row.back() <= (meant.size() < kLong ? 1u : 2u);
}

std::optional<std::size_t> Table::find(const std::vector<std::string>& any) const {
  std::optional<std::size_t> found;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const auto isName = [&](const std::string& name) { return lowerCase(name) == names[c]; };
    if (std::none_of(any.begin(), any.end(), isName)) continue;
    if (found) throw InputError(path + ":1: column " + names[c] + ": there are two such");
    found = c;
  }
  if (found) return found;
  for (const std::string& column : names) {
    for (const std::string& name : any) {
      if (!header || !isMisspelt(column, lowerCase(name))) continue;
      throw InputError(path + ":1: column " + column + ": is it " + name +
                       "? correct it, or give it a name of its own");
    }
  }
  return found;
}

std::size_t Table::need(const std::vector<std::string>& any) const {
  if (const auto column = find(any)) return *column;
  throw InputError(path + ":1: column " + any.front() + " is missing: add it");
}

std::vector<std::size_t> Table::needAll(
    const std::vector<std::vector<std::string>>& columns) const {
  std::vector<std::size_t> out;
  for (const auto& any : columns) out.push_back(need(any));
  return out;
}

std::string Table::place(std::size_t row) const {
  return path + ":" + std::to_string(line[row]) + ": ";
}

void Table::checkRising(std::size_t column) const {
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i][column] > rows[i - 1][column]) continue;
    throw InputError(place(i) + "column " + names[column] + " is " + yamlNumber(rows[i][column]) +
                     " after " + yamlNumber(rows[i - 1][column]) + ": give times that rise");
  }
}

namespace {

Table parseTable(std::istream& file, const std::string& path, const std::vector<std::string>& names,
                 bool blanks) {
  Table table;
  table.path = path;
  std::string text;
  char separator = 0;
  for (std::size_t line = 1; std::getline(file, text); ++line) {
    if (line == 1 && text.rfind("\xEF\xBB\xBF", 0) == 0) text.erase(0, 3);
    const std::string_view content = trimmed(text, " \t\r");
    if (content.empty() || content.front() == '#') continue;
    if (separator == 0) separator = separatorOf(std::string(content));
    const std::vector<std::string> cells =
        cellsOf(text, separator, table.names.empty() ? names.size() : table.names.size());
    if (table.names.empty()) {
      table.header = isHeader(cells);
      for (std::size_t c = 0; c < cells.size(); ++c) {
        table.names.push_back(table.header       ? lowerCase(cells[c])
                              : c < names.size() ? names[c]
                                                 : "column " + std::to_string(c + 1));
      }
      if (table.header) continue;
    }
    table.rows.push_back(numbersOf(table, cells, path + ":" + std::to_string(line) + ": ", blanks));
    table.line.push_back(line);
  }
  if (table.rows.empty()) throw InputError(path + ": no rows of numbers: give a CSV file");
  return table;
}

}  // namespace

Table readTable(const std::string& path, const std::vector<std::string>& names, bool blanks) {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    throw InputError(path + ": file missing or unreadable: give a CSV file");
  }
  return parseTable(file, path, names, blanks);
}

Table tableFromText(const std::string& text, const std::string& path,
                    const std::vector<std::string>& names, bool blanks) {
  std::istringstream stream(text);
  return parseTable(stream, path, names, blanks);
}

double timeUnit(const std::vector<double>& times) {
  if (times.size() < 2) return 1.0;
  const double spacing = medianSpacing(times);
  constexpr double kSlowest = 0.07;  // [s]: 1000 times that is the fastest in the next unit
  double unit = 1.0;
  while (spacing * unit > kSlowest && unit > 1e-9) unit *= 1e-3;
  return spacing * unit > 0.0 && unit >= 0.99e-9 ? unit : 1.0;
}

}  // namespace assembly_cell
