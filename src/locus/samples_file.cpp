// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/samples_file.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <sstream>
#include <utility>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

using Kind = RecordedMotion::Kind;

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

// Columns of the largest kind that the table has.
std::vector<std::vector<std::string>> wantedColumns(const Table& table, Kind& kind) {
  const auto has = [&](const char* name) {
    return std::find(table.names.begin(), table.names.end(), name) != table.names.end();
  };
  if (has("x") && has("y") && has("z") && has("rx") && has("ry") && has("rz")) {
    kind = Kind::kDisplacement;
    return {{"x"}, {"y"}, {"z"}, {"rx"}, {"ry"}, {"rz"}};
  }
  if (has("ax") && has("ay") && !has("x")) {
    kind = Kind::kAcceleration;
    return {{"ax"}, {"ay"}};
  }
  kind = Kind::kPlane;
  return {{"x"}, {"y"}};
}

std::vector<std::size_t> signalColumns(Table& table, Kind& kind) {
  const auto wanted = wantedColumns(table, kind);
  if (kind == Kind::kAcceleration) return table.needAll(wanted);
  const std::vector<std::vector<std::string>> lengths(
      wanted.begin(), wanted.begin() + (kind == Kind::kDisplacement ? 3 : 2));
  std::vector<std::size_t> columns = table.needAll(lengths, Quantity::kLength);
  if (kind == Kind::kDisplacement) {
    for (const std::size_t c : table.needAll({{"rx"}, {"ry"}, {"rz"}}, Quantity::kAngle)) {
      columns.push_back(c);
    }
  }
  return columns;
}

RecordedMotion motionOf(Table table, TimeUnit unit) {
  RecordedMotion motion;
  for (const std::string& comment : table.comments) readSettings(comment, motion);
  if (!table.header) {
    throw InputError(table.path + ":1: no header: name the columns, such as t,x,y");
  }
  const std::vector<std::size_t> columns = signalColumns(table, motion.kind);
  const auto uncertainty = table.find({"uncertainty"});
  // the format's times are in s; a header may name another unit
  const auto time = table.find({"t", "time"});
  const bool seconds = unit == TimeUnit::kFound && time && table.units[*time].empty();
  TableTimes times = readTimes(table, seconds ? TimeUnit::kSeconds : unit);
  motion.t = std::move(times.t);
  motion.time_unit = times.unit + ", " + (seconds ? "as in this format" : times.reason);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    for (std::size_t c = 0; c < 6; ++c) {
      motion.signals.push_back(c < columns.size() ? table.rows[i][columns[c]] : 0.0);
    }
    if (!uncertainty) continue;
    const double sd = table.rows[i][*uncertainty];
    if (!(sd > 0.0)) {
      throw InputError(table.place(i) + "column uncertainty is " + yamlNumber(sd) +
                       ": give a positive one");
    }
    motion.sd.push_back(sd);
  }
  return motion;
}

}  // namespace

RecordedMotion readMotion(const std::string& path, const std::string& topic, TimeUnit unit) {
  const std::vector<std::string> names = {"t", "x", "y"};
  if (std::filesystem::path(path).extension() == ".bag") {
    return motionOf(tableFromText(textFromBag("locus", path, {topic}), path, names),
                    TimeUnit::kSeconds);
  }
  if (!topic.empty()) throw InputError("--topic: value " + topic + ": is for bags only");
  return motionOf(readTable(path, names), unit);
}

}  // namespace assembly_cell
