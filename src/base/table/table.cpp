// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/table.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "cells.h"
#include "lines.h"
#include "parser.h"

namespace assembly_cell {

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
    const auto isName = [&](const std::string& name) { return columnName(name) == names[c]; };
    if (std::none_of(any.begin(), any.end(), isName)) continue;
    if (found) throw InputError(path + ":1: column " + names[c] + ": there are two such");
    found = c;
  }
  if (found && !faults[*found].empty()) throw InputError(faults[*found]);
  if (found) return found;
  for (const std::string& column : names) {
    for (const std::string& name : any) {
      if (!header || !isMisspelt(column, columnName(name))) continue;
      throw InputError(path + ":1: column " + printable(column) + ": is it " + name +
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

std::vector<std::size_t> Table::needAll(const std::vector<std::vector<std::string>>& columns,
                                        Quantity quantity) {
  constexpr std::array<const char*, 5> kSi = {"N", "N m", "m", "rad", "V"};
  const std::string si = kSi[static_cast<std::size_t>(quantity)];
  const std::vector<std::size_t> out = needAll(columns);
  std::string converted;
  for (const std::size_t c : out) {
    if (units[c].empty()) continue;
    const double factor = table::factorOf(quantity, units[c]);
    if (!(factor > 0.0)) {
      throw InputError(path + ":1: column " + names[c] + " is in '" + printable(units[c]) +
                       "': give " + si);
    }
    if (factor != 1.0) {
      for (std::vector<double>& row : rows) row[c] *= factor;
      converted += (converted.empty() ? "" : ", ") + names[c] + " from " + printable(units[c]);
    }
    units[c].clear();
  }
  if (!converted.empty()) notes.push_back("converted to " + si + ": " + converted);
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

std::vector<std::size_t> wrenchColumns(Table& table, const std::string& prefix) {
  // a column of text may hold the unit of all rows (ATI)
  for (const auto& [name, letters] :
       {std::pair{"force_unit", "f"}, std::pair{"torque_unit", "tm"}}) {
    for (std::size_t c = 0; c < table.names.size(); ++c) {
      if (columnName(table.names[c]) != name || !table.isText(c)) continue;
      const std::string unit = table.words[c].empty() ? "several units" : table.words[c];
      for (std::size_t k = 0; k < table.names.size(); ++k) {
        const std::string& other = table.names[k];
        if (other.size() == 2 && std::string(letters).find(other[0]) != std::string::npos &&
            std::string("xyz").find(other[1]) != std::string::npos && table.units[k].empty()) {
          table.units[k] = unit;
        }
      }
    }
  }
  std::vector<std::size_t> out =
      table.needAll({{prefix + "fx"}, {prefix + "fy"}, {prefix + "fz"}}, Quantity::kForce);
  const std::vector<std::size_t> torque = table.needAll({{prefix + "tx", prefix + "mx"},
                                                         {prefix + "ty", prefix + "my"},
                                                         {prefix + "tz", prefix + "mz"}},
                                                        Quantity::kTorque);
  out.insert(out.end(), torque.begin(), torque.end());
  return out;
}

Table tableFromStream(std::istream& stream, const std::string& path,
                      const std::vector<std::string>& names, bool blanks) {
  table::Lines lines(stream, path);
  table::Parser parser(path, names, blanks);
  std::string line;
  while (lines.next(line)) parser.add(line, lines.number());
  return parser.finish();
}

Table readTable(const std::string& path, const std::vector<std::string>& names, bool blanks) {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    throw InputError(path + ": file missing or unreadable: give a CSV file");
  }
  return tableFromStream(file, path, names, blanks);
}

Table tableFromText(const std::string& text, const std::string& path,
                    const std::vector<std::string>& names, bool blanks) {
  std::istringstream stream(text);
  return tableFromStream(stream, path, names, blanks);
}

}  // namespace assembly_cell
