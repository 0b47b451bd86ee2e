// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/replay.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <istream>
#include <string_view>
#include <utility>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

namespace {

constexpr double kLatestStamp = 4294967295.0;   // what ros::Time holds [s]
constexpr std::size_t kLongestRow = 64 * 1024;  // [bytes]
constexpr std::size_t kMaxRows = 50000000;      // 3 GB in memory

bool parse(std::string_view field, double& value) {
  if (!field.empty() && field.front() == '+') field.remove_prefix(1);
  const char* end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, value);
  return error == std::errc() && stop == end;
}

std::vector<std::string> neededColumns(SampleQuantity quantity) {
  if (quantity == SampleQuantity::kWrench) return {"t", "fx", "fy", "fz", "tx", "ty", "tz"};
  return {"t", "ch1", "ch2", "ch3", "ch4", "ch5", "ch6"};
}

// where the needed names stand among `names`; empty if one isn't there exactly once
std::vector<std::size_t> locate(const std::vector<std::string>& needed,
                                const std::vector<std::string>& names) {
  std::vector<std::size_t> places;
  for (const std::string& name : needed) {
    if (std::count(names.begin(), names.end(), name) != 1) return {};
    places.push_back(
        static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin()));
  }
  return places;
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// Reads row after row into a recording. Errors don't name the place.
class RowReader {
 public:
  explicit RowReader(const ReplayFormat& format)
      : format_(format),
        needed_(neededColumns(format.quantity)),
        columns_(format.columns.empty() ? defaultColumns(format.quantity) : format.columns),
        places_(locate(needed_, columns_)),
        row_(columns_.size()) {
    if (format.bits < 2 || format.bits > 32) {
      throw InputError("replay: bits is " + std::to_string(format.bits) + ": give 2 to 32");
    }
    if (!(format.full_scale > 0.0) || !std::isfinite(format.full_scale)) {
      throw InputError("replay: full_scale is " + std::to_string(format.full_scale) +
                       ": give volts above 0");
    }
    if (places_.empty()) {
      throw InputError("replay: columns are '" + join(columns_) + "': name each of '" +
                       join(needed_) + "' once");
    }
  }

  void read(std::string_view content, Recording& recording) {
    if (!parseRow(csvCells(content))) return;
    const double t = row_[places_[0]];
    if (t < 0.0 || t > kLatestStamp) {
      throw InputError("time is " + std::to_string(t) + ": give seconds from 0 to 4.29e9");
    }
    if (!recording.time.empty() && t <= recording.time.back()) {
      throw InputError("time goes from " + std::to_string(recording.time.back()) + " to " +
                       std::to_string(t) + ": rows must increase in time");
    }
    Vector6 value;
    std::uint8_t saturated = 0;
    for (std::size_t k = 0; k < 6; ++k) {
      value[static_cast<Eigen::Index>(k)] = channel(k, saturated);
    }
    if (recording.time.size() == kMaxRows) {
      throw InputError("the recording has more than " + std::to_string(kMaxRows) + " rows: cut it");
    }
    recording.time.push_back(t);
    recording.values.push_back(value);
    recording.saturated.push_back(saturated);
  }

 private:
  /// False for a header, which may order the columns.
  bool parseRow(const std::vector<std::string_view>& fields) {
    if (fields.size() != columns_.size()) {
      throw InputError(std::to_string(fields.size()) + " columns instead of " +
                       std::to_string(columns_.size()) + ": mend the row or name the columns (" +
                       join(columns_) + ")");
    }
    double probe = 0.0;
    if (std::exchange(first_, false) && !parse(fields[0], probe)) {
      const auto header = locate(needed_, {fields.begin(), fields.end()});
      if (!header.empty()) places_ = header;
      return false;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (!parse(fields[i], row_[i]) || !std::isfinite(row_[i])) {
        throw InputError("column " + std::to_string(i + 1) + " is '" +
                         printable(std::string(fields[i])) + "': give a finite number");
      }
    }
    return true;
  }

  double channel(std::size_t k, std::uint8_t& saturated) const {
    const double entry = row_[places_[k + 1]];
    if (format_.quantity == SampleQuantity::kWrench) return entry;
    const bool counts = format_.quantity == SampleQuantity::kCounts;
    const double codes = std::ldexp(1.0, format_.bits - 1);
    if (counts && (entry != std::nearbyint(entry) || entry < -codes || entry > codes - 1.0)) {
      throw InputError(needed_[k + 1] + " is " + std::to_string(entry) + ": not a code of " +
                       std::to_string(format_.bits) + " bits; set bits");
    }
    const double low = counts ? -codes : -format_.full_scale;
    const double high = counts ? codes - 1.0 : format_.full_scale;
    if (entry <= low || entry >= high) saturated = static_cast<std::uint8_t>(saturated | (1u << k));
    return counts ? entry * (format_.full_scale / codes) : entry;
  }

  const ReplayFormat& format_;
  const std::vector<std::string> needed_, columns_;
  std::vector<std::size_t> places_;
  std::vector<double> row_;
  bool first_ = true;
};

}  // namespace

std::vector<std::string> defaultColumns(SampleQuantity quantity) {
  std::vector<std::string> columns = neededColumns(quantity);
  if (quantity == SampleQuantity::kWrench) {
    for (const char* name : {"qx", "qy", "qz", "qw"}) columns.emplace_back(name);
  }
  return columns;
}

Recording loadRecording(const std::string& path, const ReplayFormat& format) {
  std::ifstream file(path);
  if (!file) throw InputError("recording '" + path + "' can't be read: give an existing file");
  return readRecording(file, path, format);
}

Recording readRecording(std::istream& stream, const std::string& name, const ReplayFormat& format) {
  RowReader reader(format);
  Recording recording;
  std::vector<char> line(kLongestRow);
  for (std::size_t number = 1;
       stream.getline(line.data(), static_cast<std::streamsize>(line.size())); ++number) {
    // the newline counts, the end of the file doesn't
    const auto length = static_cast<std::size_t>(stream.gcount()) - (stream.eof() ? 0 : 1);
    const std::string_view content = trimmed({line.data(), length});
    if (content.empty() || content.front() == '#') continue;
    try {
      reader.read(content, recording);
    } catch (const InputError& error) {
      throw InputError(name + ":" + std::to_string(number) + ": " + error.what());
    }
  }
  if (!stream.eof()) {
    throw InputError("recording '" + name + "' has a row of more than " +
                     std::to_string(kLongestRow) + " bytes, or can't be read to its end");
  }
  if (recording.time.size() < 2) {
    throw InputError("recording '" + name + "' has " + std::to_string(recording.time.size()) +
                     " rows: give at least 2");
  }

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
