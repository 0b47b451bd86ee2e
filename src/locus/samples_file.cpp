// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/samples_file.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <istream>
#include <sstream>
#include <string_view>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

using Kind = RecordedMotion::Kind;

std::vector<std::string> cellsOf(const std::string& line) {
  const auto cells = csvCells(line);
  return {cells.begin(), cells.end()};
}

// settings as from_bag.py writes them: # key=value key=value
void readSettings(const std::string& line, RecordedMotion& motion) {
  std::istringstream words(line.substr(1));
  std::string word;
  while (words >> word) {
    const std::size_t equals = word.find('=');
    double value = 0.0;
    if (equals == std::string::npos || !parseNumber(word.substr(equals + 1), value)) continue;
    const std::string key = word.substr(0, equals);
    if (key == "frequency") motion.frequency = value;
    if (key == "amplitude") motion.amplitude = value;
    if (key == "direction") motion.direction = value < 0.0 ? -1 : 1;
  }
}

// Columns of the largest kind that the header has.
std::vector<std::string> wantedColumns(const std::vector<std::string>& header, Kind& kind) {
  const auto has = [&](const char* name) {
    return std::find(header.begin(), header.end(), name) != header.end();
  };
  if (has("x") && has("y") && has("z") && has("rx") && has("ry") && has("rz")) {
    kind = Kind::kDisplacement;
    return {"t", "x", "y", "z", "rx", "ry", "rz"};
  }
  if (has("ax") && has("ay") && !has("x")) {
    kind = Kind::kAcceleration;
    return {"t", "ax", "ay"};
  }
  kind = Kind::kPlane;
  return {"t", "x", "y"};
}

// Blank or a comment.
bool isSkipped(const std::string& line) {
  const std::string_view text = trimmed(line, " \t\r");
  return text.empty() || text.front() == '#';
}

RecordedMotion parseMotion(std::istream& file, const std::string& path) {
  RecordedMotion motion;
  std::string line;
  std::size_t row = 0;
  do {
    ++row;
    if (!std::getline(file, line)) {
      throw InputError(path + ": no samples: give a CSV file with the header t,x,y");
    }
    if (row == 1 && line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
    if (line.rfind("#", 0) == 0) readSettings(line, motion);
  } while (isSkipped(line));

  // columns by name
  const std::vector<std::string> header = cellsOf(line);
  std::vector<std::string> names = wantedColumns(header, motion.kind);
  const std::size_t values_end = names.size();
  if (std::find(header.begin(), header.end(), "uncertainty") != header.end()) {
    names.push_back("uncertainty");
  }
  for (const std::string& name : header) {
    if (names.back() == "uncertainty" || !isMisspelt(name, "uncertainty")) continue;
    throw InputError(path + ":" + std::to_string(row) + ": column " + printable(name) +
                     ": is it uncertainty? correct it, or give it a name of its own");
  }
  std::vector<std::size_t> column(names.size());
  for (std::size_t c = 0; c < names.size(); ++c) {
    const auto count = std::count(header.begin(), header.end(), names[c]);
    if (count != 1) {
      throw InputError(path + ":" + std::to_string(row) + ": column " + names[c] +
                       (count == 0 ? " is missing" : " is there twice") +
                       ": give the header t,x,y");
    }
    column[c] = static_cast<std::size_t>(std::find(header.begin(), header.end(), names[c]) -
                                         header.begin());
  }

  std::vector<double> values(names.size());
  while (std::getline(file, line)) {
    ++row;
    if (isSkipped(line)) continue;
    const std::string place = path + ":" + std::to_string(row) + ": column ";
    const std::vector<std::string> cells = cellsOf(line);
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (column[c] >= cells.size()) {
        throw InputError(place + names[c] + " is missing: give " + std::to_string(header.size()) +
                         " columns as in the header");
      }
      const std::string& text = cells[column[c]];
      if (!parseNumber(text, values[c])) {
        throw InputError(place + names[c] + " is '" + text + "': give a finite number");
      }
      if (c >= values_end && !(values[c] > 0.0)) {
        throw InputError(place + names[c] + " is '" + text + "': give a positive one");
      }
    }
    if (cells.size() > header.size()) {
      throw InputError(place + std::to_string(header.size() + 1) + " is '" + cells[header.size()] +
                       "': give " + std::to_string(header.size()) + " columns as in the header");
    }
    if (!motion.t.empty() && values[0] <= motion.t.back()) {
      throw InputError(place + "t is '" + cells[column[0]] + "': give times that rise");
    }
    motion.t.push_back(values[0]);
    for (std::size_t c = 1; c < 7; ++c) {
      motion.signals.push_back(c < values_end ? values[c] : 0.0);
    }
    if (values_end < names.size()) motion.sd.push_back(values[values_end]);
  }
  return motion;
}

}  // namespace

RecordedMotion readMotion(const std::string& path, const std::string& topic) {
  if (std::filesystem::path(path).extension() == ".bag") {
    std::istringstream text(textFromBag("locus", path, topic));
    return parseMotion(text, path);
  }
  if (!topic.empty()) throw InputError("--topic: value " + topic + ": is for bags only");
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path) ||
      file.peek() == std::ifstream::traits_type::eof()) {
    throw InputError(path + ": file missing, unreadable or empty: give a CSV file with t,x,y");
  }
  return parseMotion(file, path);
}

}  // namespace assembly_cell
