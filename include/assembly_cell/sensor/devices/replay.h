// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// How to read a recording.
struct ReplayFormat {
  SampleQuantity quantity = SampleQuantity::kWrench;
  /// Names of the columns, in order, of a file without a header or with one that names none of the
  /// needed columns. Needed are t and fx fy fz tx ty tz, or ch1 … ch6 for counts and volts; others
  /// are passed over. Empty: defaultColumns(), or the first seven of them.
  std::vector<std::string> columns;
  int bits = 16;            ///< of the converter (counts)
  double full_scale = 5.0;  ///< ± of the converter [V] (counts, volts)
  TimeUnit time_unit = TimeUnit::kFound;
};

/// wrench: t fx fy fz tx ty tz qx qy qz qw; counts, volts: t ch1 … ch6.
std::vector<std::string> defaultColumns(SampleQuantity quantity);

/// A recording in memory.
struct Recording {
  std::vector<double> time;             ///< [s], increasing
  std::vector<Vector6> values;          ///< [V] (counts, volts) or [N], [N·m] (wrench)
  std::vector<std::uint8_t> saturated;  ///< bit k: channel k at an end code; zero for wrenches
  double period = 0.0;                  ///< median spacing [s]
  std::string note;                     ///< unit of time of the file, unit conversions; for the log
};

/// Reads a table (base/table.h). Throws InputError with file:line for a row with the wrong number
/// of columns, a needed entry that is no finite number, a code outside the converter's, time that
/// doesn't increase or can't be a stamp; for a header without the needed columns, a unit of time
/// that can't be determined, more than 5e7 rows or fewer than two; and for an unreadable file.
Recording loadRecording(const std::string& path, const ReplayFormat& format);

/// Reads a recording from a stream; `name` names it in messages.
Recording readRecording(std::istream& stream, const std::string& name, const ReplayFormat& format);

/// Samples [first, first + size) of a recording, to be published together.
struct ReplayBlock {
  std::size_t first = 0;
  std::size_t size = 0;
  double time = 0.0;           ///< of sample 0 on the recording's time base, loops appended [s]
  std::uint32_t sequence = 0;  ///< from 0 on
};

/// Cuts a recording into blocks of evenly spaced samples: a block ends early before a sample that
/// is off its time by more than half a period. A loop goes on in time where the recording ended.
class Replay {
 public:
  /// Throws InputError for block_size 0.
  Replay(Recording recording, std::size_t block_size, bool loop);

  /// The next block, or false at the end.
  bool next(ReplayBlock& block);

  const Recording& recording() const { return recording_; }

 private:
  Recording recording_;
  std::size_t block_size_;
  bool loop_;
  std::size_t position_ = 0;
  double offset_ = 0.0;
  std::uint32_t sequence_ = 0;
};

}  // namespace assembly_cell
