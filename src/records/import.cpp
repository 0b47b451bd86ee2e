// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/import.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kSince1970 = 1e8;  // [s]
constexpr const char* kTorques = "_R_Torques.dat";

std::vector<double> columnOf(const Table& table, std::size_t column) {
  std::vector<double> values;
  values.reserve(table.rows.size());
  for (const std::vector<double>& row : table.rows) values.push_back(row[column]);
  return values;
}

std::vector<double> lengthsOf(const Table& table, const std::vector<std::size_t>& columns) {
  std::vector<double> values;
  values.reserve(table.rows.size());
  for (const std::vector<double>& row : table.rows) {
    values.push_back(std::hypot(row[columns[0]], row[columns[1]]));
  }
  return values;
}

// One column of these names in the quantity's unit; else NaN.
std::vector<double> oneColumn(Table& table, const std::vector<std::string>& names,
                              Quantity quantity) {
  if (!table.find(names)) return std::vector<double>(table.rows.size(), kNaN);
  return columnOf(table, table.needAll({names}, quantity)[0]);
}

// A column, or the length of two components.
std::vector<double> acrossColumn(Table& table, const std::string& name,
                                 const std::vector<std::vector<std::string>>& components,
                                 Quantity quantity) {
  const bool both = table.find(components[0]) && table.find(components[1]);
  if (table.find({name}) || !both) return oneColumn(table, {name}, quantity);
  return lengthsOf(table, table.needAll(components, quantity));
}

void setSpan(const std::string& path, Run& run) {
  if (run.curve.size() < 2) throw InputError(path + ": no curve: at least two rows are needed");
  const double duration = run.curve.time.back() - run.curve.time.front();
  run.duration = std::isnan(duration) ? 0.0 : duration;
  run.station = "imported";
  run.versions["source"] = path;
}

// A table without a header, in the order of `names`.
Table plainTable(const std::string& path, const std::vector<std::string>& names) {
  return tableFromText(gzipText(path), path, names);
}

std::optional<std::string> existing(const std::string& path) {
  for (const std::string& candidate : {path, path + ".gz"}) {
    std::error_code error;
    if (fs::is_regular_file(candidate, error)) return candidate;
  }
  return std::nullopt;
}

// Time of the second row of a file of states; none: no such file or row.
std::optional<double> endOfApproach(const std::string& path) {
  const std::string states = gzipText(path);
  double time = 0.0;
  int used = 0;
  if (std::sscanf(states.c_str(), "%*f %n", &used) != 0 || used == 0) return std::nullopt;
  if (std::sscanf(states.c_str() + used, "%lf", &time) != 1 || !std::isfinite(time)) {
    return std::nullopt;
  }
  return time;
}

// Heights of the tool at these times, from the first one down; the nearest earlier row's.
std::vector<double> depthsAt(const std::string& path, const std::vector<double>& times) {
  const Table table = plainTable(path, {"t", "x", "y", "z", "roll", "pitch", "yaw"});
  const std::size_t t = table.need({"t"}), z = table.need({"z"});
  std::vector<double> depths;
  std::size_t row = 0;
  for (const double time : times) {
    while (row + 1 < table.rows.size() && table.rows[row + 1][t] <= time) ++row;
    depths.push_back(table.rows.front()[z] - table.rows[row][z]);
  }
  return depths;
}

Run readSnapFit(const std::string& path) {
  const std::size_t at = path.rfind(kTorques);
  const std::string stem = path.substr(0, at);
  Table table = plainTable(path, {"t", "fx", "fy", "fz", "tx", "ty", "tz"});
  const std::vector<std::size_t> wrench = wrenchColumns(table);
  const std::size_t t = table.need({"t"});
  Run run;
  run.serial = fs::path(stem).filename().string();
  run.curve.time = columnOf(table, t);
  run.curve.axial = columnOf(table, wrench[2]);
  run.curve.lateral = lengthsOf(table, {wrench[0], wrench[1]});
  run.curve.moment = lengthsOf(table, {wrench[3], wrench[4]});
  run.curve.depth.assign(table.rows.size(), kNaN);
  run.curve.tilt.assign(table.rows.size(), kNaN);
  setSpan(path, run);
  if (const auto poses = existing(stem + "_R_CartPos.dat")) {
    run.curve.depth = depthsAt(*poses, run.curve.time);
  }
  run.text = "time counts from the first sample";
  if (const auto states = existing(stem + "_R_State.dat")) {
    if (const auto approached = endOfApproach(*states)) {
      for (double& time : run.curve.time) time -= *approached;
      run.text = text("time counts from the end of the approach, %g s after the first sample",
                      *approached);
    }
  }
  return run;
}

std::string stemOf(const std::string& path) {
  std::string name = fs::path(path).filename().string();
  for (const char* ending : {".gz", ".csv", ".txt", ".dat"}) {
    const std::string end = ending;
    if (name.size() > end.size() && name.substr(name.size() - end.size()) == end) {
      name.resize(name.size() - end.size());
    }
  }
  return name;
}

const std::vector<std::string> kDepth = {"depth"}, kAxial = {"axial", "force", "fz"};
const std::vector<std::string> kTime = {"t", "time", "timestamp", "stamp"};

Run readCurve(const std::string& path, Table table, TimeUnit unit) {
  Run run;
  if (table.find(kTime)) {
    run.curve.time = readTimes(table, unit).t;
    const double start = run.curve.time.front();
    if (start > kSince1970) run.start = start;
    for (double& t : run.curve.time) t -= start;
  } else {
    run.curve.time.assign(table.rows.size(), kNaN);
  }
  run.curve.depth = oneColumn(table, kDepth, Quantity::kLength);
  run.curve.axial = oneColumn(table, kAxial, Quantity::kForce);
  run.curve.lateral = acrossColumn(table, "lateral", {{"fx"}, {"fy"}}, Quantity::kForce);
  run.curve.moment = acrossColumn(table, "moment", {{"tx", "mx"}, {"ty", "my"}}, Quantity::kTorque);
  run.curve.tilt = oneColumn(table, {"tilt"}, Quantity::kAngle);
  setSpan(path, run);
  return run;
}

}  // namespace

std::string gzipText(const std::string& path, std::size_t largest) {
  std::error_code error;
  if (fs::is_directory(path, error)) throw InputError(path + ": a folder: give a file");
  const gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) throw InputError(path + ": can't be opened");
  std::string out;
  std::vector<char> buffer(1 << 16);
  int got = 0;
  while ((got = gzread(file, buffer.data(), static_cast<unsigned>(buffer.size()))) > 0) {
    out.append(buffer.data(), static_cast<std::size_t>(got));
    if (out.size() > largest) break;
  }
  int code = Z_OK;
  gzerror(file, &code);
  gzclose(file);
  if (out.size() > largest) {
    throw InputError(
        text("%s: more than %zu MB: give a shorter recording", path.c_str(), largest >> 20));
  }
  if (got < 0 || (code != Z_OK && code != Z_STREAM_END)) {
    throw InputError(path + ": can't be decompressed: the file is broken off or damaged");
  }
  return out;
}

std::vector<Run> readCurveFile(const std::string& path, TimeUnit unit) {
  Table table = tableFromText(gzipText(path), path, {"depth", "axial"}, true);
  if (!table.find(kDepth) && !table.find(kTime)) {
    throw InputError(path + ": no column depth and none t: name one of them in the header");
  }
  table.need(kAxial);
  const std::string name = stemOf(path);
  const std::optional<std::size_t> number = table.find({"run"});
  std::vector<Run> runs;
  if (!number) {
    runs.push_back(readCurve(path, std::move(table), unit));
    runs.back().serial = name;
    return runs;
  }
  std::vector<std::vector<double>> rows = std::move(table.rows);
  const std::vector<std::size_t> lines = std::move(table.line);
  for (std::size_t first = 0, end = 0; first < rows.size(); first = end) {
    const double group = rows[first][*number];
    Table part = table;
    part.rows.clear();
    part.line.clear();
    for (end = first; end < rows.size() && rows[end][*number] == group; ++end) {
      part.rows.push_back(std::move(rows[end]));
      part.line.push_back(lines[end]);
    }
    if (end == first) throw InputError(part.path + text(":%zu: run isn't a number", lines[first]));
    runs.push_back(readCurve(path, std::move(part), unit));
    runs.back().serial = name + text("-%.15g", group);
  }
  return runs;
}

std::vector<Run> readCurveFolder(const std::string& folder, TimeUnit unit) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    files.push_back(it->path().string());
  }
  if (error) throw InputError(folder + ": can't be listed (" + error.message() + ")");
  std::sort(files.begin(), files.end());
  std::vector<Run> runs;
  const auto endsWith = [](const std::string& name, const std::string& end) {
    return name.size() >= end.size() && name.substr(name.size() - end.size()) == end;
  };
  for (const std::string& file : files) {
    if (endsWith(file, kTorques) || endsWith(file, std::string(kTorques) + ".gz")) {
      runs.push_back(readSnapFit(file));
    } else if (endsWith(file, ".csv") || endsWith(file, ".csv.gz")) {
      std::vector<Run> more = readCurveFile(file, unit);
      std::move(more.begin(), more.end(), std::back_inserter(runs));
    }
  }
  if (runs.empty()) {
    throw InputError(folder + ": no *.csv and no *" + kTorques +
                     "[.gz]: give a folder with curves");
  }
  return runs;
}

}  // namespace assembly_cell
