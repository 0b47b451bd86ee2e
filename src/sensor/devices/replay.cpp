// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/replay.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <istream>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"

namespace assembly_cell {

namespace {

constexpr double kLatestStamp = 4294967295.0;  // what ros::Time holds [s]

std::vector<std::string> valueColumns(SampleQuantity quantity) {
  if (quantity == SampleQuantity::kWrench) return {"fx", "fy", "fz", "tx", "ty", "tz"};
  return {"ch1", "ch2", "ch3", "ch4", "ch5", "ch6"};
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

void check(const ReplayFormat& format) {
  if (format.bits < 2 || format.bits > 32) {
    throw InputError("replay: bits is " + std::to_string(format.bits) + ": give 2 to 32");
  }
  if (!(format.full_scale > 0.0) || !std::isfinite(format.full_scale)) {
    throw InputError("replay: full_scale is " + std::to_string(format.full_scale) +
                     ": give volts above 0");
  }
  if (format.columns.empty()) return;
  std::vector<std::string> needed = valueColumns(format.quantity);
  needed.insert(needed.begin(), "t");
  for (const std::string& name : needed) {
    if (std::count(format.columns.begin(), format.columns.end(), name) == 1) continue;
    throw InputError("replay: columns are '" + join(format.columns) + "': name each of '" +
                     join(needed) + "' once");
  }
}

// The names that the format gives, where the file has none of the needed ones.
void nameColumns(Table& table, const ReplayFormat& format) {
  const auto is_value = [&](const std::string& name) {
    const auto values = valueColumns(format.quantity);
    return std::count(values.begin(), values.end(), name) > 0;
  };
  const bool named = std::any_of(table.names.begin(), table.names.end(), is_value);
  if (table.header && (named || format.columns.empty())) return;
  const std::size_t n = table.names.size();
  const std::size_t least = valueColumns(format.quantity).size() + 1;
  const std::size_t most =
      format.columns.empty() ? defaultColumns(format.quantity).size() : format.columns.size();
  if (n != most && (n != least || !format.columns.empty())) {
    throw InputError(
        table.place(0) + std::to_string(n) + " columns instead of " + std::to_string(most) +
        ": name them in a header, or mend columns (" +
        join(format.columns.empty() ? defaultColumns(format.quantity) : format.columns) + ")");
  }
  if (!table.header) return;
  for (std::size_t c = 0; c < n; ++c) table.names[c] = columnName(format.columns[c]);
}

std::vector<std::size_t> valuesOf(Table& table, SampleQuantity quantity) {
  if (quantity == SampleQuantity::kWrench) return wrenchColumns(table);
  std::vector<std::vector<std::string>> columns;
  for (const std::string& name : valueColumns(quantity)) columns.push_back({name});
  return quantity == SampleQuantity::kVolts ? table.needAll(columns, Quantity::kVoltage)
                                            : table.needAll(columns);
}

// In V for counts and volts; marks end codes.
double channel(double entry, const ReplayFormat& format, const std::string& place,
               std::uint8_t& saturated, std::size_t k) {
  if (format.quantity == SampleQuantity::kWrench) return entry;
  const bool counts = format.quantity == SampleQuantity::kCounts;
  const double codes = std::ldexp(1.0, format.bits - 1);
  if (counts && (entry != std::nearbyint(entry) || entry < -codes || entry > codes - 1.0)) {
    throw InputError(place + "ch" + std::to_string(k + 1) + " is " + std::to_string(entry) +
                     ": not a code of " + std::to_string(format.bits) + " bits; set bits");
  }
  const double low = counts ? -codes : -format.full_scale;
  const double high = counts ? codes - 1.0 : format.full_scale;
  if (entry <= low || entry >= high) saturated = static_cast<std::uint8_t>(saturated | (1u << k));
  return counts ? entry * (format.full_scale / codes) : entry;
}

}  // namespace

std::vector<std::string> defaultColumns(SampleQuantity quantity) {
  std::vector<std::string> columns = valueColumns(quantity);
  columns.insert(columns.begin(), "t");
  if (quantity == SampleQuantity::kWrench) {
    for (const char* name : {"qx", "qy", "qz", "qw"}) columns.emplace_back(name);
  }
  return columns;
}

Recording loadRecording(const std::string& path, const ReplayFormat& format) {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    throw InputError("recording '" + path + "' can't be read: give an existing file");
  }
  return readRecording(file, path, format);
}

Recording readRecording(std::istream& stream, const std::string& name, const ReplayFormat& format) {
  check(format);
  Table table = tableFromStream(
      stream, name, format.columns.empty() ? defaultColumns(format.quantity) : format.columns);
  nameColumns(table, format);
  const std::vector<std::size_t> column = valuesOf(table, format.quantity);
  TableTimes times = readTimes(table, format.time_unit);
  Recording recording;
  recording.note = "time in " + times.unit + ", " + times.reason;
  for (const std::string& note : table.notes) recording.note += "; " + note;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    if (times.t[i] < 0.0 || times.t[i] > kLatestStamp) {
      throw InputError(table.place(i) + "time is " + std::to_string(times.t[i]) +
                       ": give seconds from 0 to 4.29e9");
    }
    Vector6 value;
    std::uint8_t saturated = 0;
    for (std::size_t k = 0; k < 6; ++k) {
      value[static_cast<Eigen::Index>(k)] =
          channel(table.rows[i][column[k]], format, table.place(i), saturated, k);
    }
    recording.values.push_back(value);
    recording.saturated.push_back(saturated);
  }
  if (table.rows.size() < 2) {
    throw InputError("recording '" + name + "' has " + std::to_string(table.rows.size()) +
                     " rows: give at least 2");
  }
  recording.time = std::move(times.t);
  recording.period = medianSpacing(recording.time);
  return recording;
}

Replay::Replay(Recording recording, std::size_t block_size, bool loop)
    : recording_(std::move(recording)), block_size_(block_size), loop_(loop) {
  if (block_size_ == 0) throw InputError("replay: block_size is 0: give at least 1");
}

bool Replay::next(ReplayBlock& block) {
  const std::vector<double>& time = recording_.time;
  if (position_ == time.size()) {
    if (!loop_) return false;
    offset_ += time.back() - time.front() + recording_.period;
    position_ = 0;
  }
  const double start = time[position_];
  std::size_t size = 1;
  while (size < block_size_ && position_ + size < time.size() &&
         std::abs(time[position_ + size] - start - static_cast<double>(size) * recording_.period) <=
             0.5 * recording_.period) {
    ++size;
  }
  block = {position_, size, start + offset_, sequence_++};
  position_ += size;
  return true;
}

}  // namespace assembly_cell
