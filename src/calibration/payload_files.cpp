// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload_files.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <optional>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

struct Table {
  bool header = false;
  std::vector<std::string> names;  // lower case
  std::vector<std::vector<double>> rows;
  std::vector<std::size_t> line;  // of each row
};

// a comma at the end of a row makes no cell
std::vector<std::string> cellsOf(const std::string& text) {
  auto cells = csvCells(text, " \t\r\"");
  if (!text.empty() && text.back() == ',') cells.pop_back();
  return {cells.begin(), cells.end()};
}

Table readTable(const std::string& path, const std::vector<std::string>& columns,
                const std::vector<std::string>& further) {
  std::ifstream file(path);
  if (!file) throw InputError(path + ": file missing or unreadable: give a CSV file");
  Table table;
  std::string text;
  for (std::size_t line = 1; std::getline(file, text); ++line) {
    if (line == 1 && text.rfind("\xEF\xBB\xBF", 0) == 0) text.erase(0, 3);
    if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#') continue;
    const std::vector<std::string> cells = cellsOf(text);
    double value = 0.0;
    if (table.names.empty()) {
      table.header = !cells.empty() && !parseNumber(cells[0], value) && !cells[0].empty() &&
                     std::isalpha(static_cast<unsigned char>(cells[0][0])) != 0 &&
                     cells[0] != "nan" && cells[0] != "NaN" && cells[0] != "inf";
      if (table.header) {
        for (std::string name : cells) {
          std::transform(name.begin(), name.end(), name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
          table.names.push_back(name);
        }
        continue;
      }
      table.names = columns;
      for (const std::string& name : further) {
        if (table.names.size() < cells.size()) table.names.push_back(name);
      }
    }
    const std::string place = path + ":" + std::to_string(line) + ": ";
    if (cells.size() != table.names.size()) {
      throw InputError(place + std::to_string(cells.size()) + " columns: give " +
                       std::to_string(table.names.size()) + " as in the first row");
    }
    std::vector<double> row;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (!parseNumber(cells[c], value)) {
        throw InputError(place + "column " + table.names[c] + " is '" + cells[c] +
                         "': give a finite number");
      }
      row.push_back(value);
    }
    table.rows.push_back(std::move(row));
    table.line.push_back(line);
  }
  if (table.rows.empty()) throw InputError(path + ": no rows: give one row a pose");
  return table;
}

// index of the one column with one of these names; none if absent
std::optional<std::size_t> columnOf(const Table& table, const std::string& path,
                                    const std::vector<std::string>& names) {
  std::optional<std::size_t> found;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    if (std::find(names.begin(), names.end(), table.names[c]) == names.end()) continue;
    if (found) throw InputError(path + ":1: column " + table.names[c] + ": there are two such");
    found = c;
  }
  return found;
}

std::size_t needColumn(const Table& table, const std::string& path, const std::string& name) {
  const auto column = columnOf(table, path, {name});
  if (!column) throw InputError(path + ":1: column " + name + " is missing: add it");
  return *column;
}

}  // namespace

Poses readPoses(const std::string& path) {
  const Table table = readTable(path, {"x", "y", "z", "qx", "qy", "qz", "qw"}, {"order"});
  std::array<std::size_t, 4> q{};
  const std::array<const char*, 4> names = {"qx", "qy", "qz", "qw"};
  for (std::size_t k = 0; k < 4; ++k) q[k] = needColumn(table, path, names[k]);
  const auto order = columnOf(table, path, {"order", "index", "time", "t"});
  const auto temperature = columnOf(table, path, {"temperature"});
  Poses out;
  out.ordered = order.has_value();
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Eigen::Quaterniond rotation(row[q[3]], row[q[0]], row[q[1]], row[q[2]]);
    const double norm = rotation.norm();
    if (!(std::abs(norm - 1.0) < 0.01)) {
      throw InputError(path + ":" + std::to_string(table.line[i]) + ": quaternion has length " +
                       yamlNumber(norm) + ": give a unit quaternion qx,qy,qz,qw");
    }
    StaticPose pose;
    pose.R = rotation.normalized().toRotationMatrix();
    pose.order = order ? row[*order] : static_cast<double>(i);
    if (temperature) pose.temperature = row[*temperature];
    out.values.push_back(pose);
  }
  return out;
}

Wrenches readWrenches(const std::string& path) {
  const std::vector<std::string> names = {"fx", "fy", "fz", "tx", "ty", "tz"};
  const Table table = readTable(path, names, {});
  Wrenches out;
  out.header = table.header;
  const auto temperature = columnOf(table, path, {"temperature"});
  for (const std::vector<double>& row : table.rows) {
    Vector6 w;
    for (std::size_t k = 0; k < 6; ++k) {
      w[static_cast<Eigen::Index>(k)] = row[needColumn(table, path, names[k])];
    }
    out.values.push_back(w);
    if (temperature) out.temperature.push_back(row[*temperature]);
  }
  return out;
}

}  // namespace assembly_cell
