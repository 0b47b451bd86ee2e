// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/base/journal.h"

namespace assembly_cell {

/// Journal of records that survives a kill or a power cut at any moment: what append() returned
/// from is on disk. A plain text file: a header of any lines, then one record a line. The header's
/// last line and every record end with a seal, "  # <number> crc32:<eight digits>", number 0 for
/// the header: for YAML a comment, so that a journal of observation lines is an observation file.
/// One process at a time has a journal open (a lock on PATH.lock).
class ObservationLog {
 public:
  /// Opens or creates. A last line that a crash cut off was never acknowledged and is cut off;
  /// torn() is then true. Throws InputError naming file and line: no journal, a line whose
  /// seal is wrong or missing, records with another header than `header` (one without records
  /// is replaced), another process has it open, or the file can't be written.
  /// `header`: at least one line, each with its end of line.
  ObservationLog(const std::string& path, const std::string& header);

  /// Returns after fsync. Throws InputError for a record that is empty or not one line, or when it
  /// can't be written; the journal is then as before.
  void append(const std::string& record);

  /// Removes the last record and returns after fsync. Throws InputError when there is none.
  void removeLast();

  /// Starts an empty journal with `header`; the old file is kept as PATH.previous.
  void clear(const std::string& header);

  const std::vector<std::string>& records() const { return records_; }
  const std::string& path() const { return journal_.path(); }
  bool torn() const { return torn_; }
  /// Number of acknowledged records that are missing because the file was cut, by the count in
  /// PATH.count; 0 without that file.
  std::size_t lost() const { return lost_; }

 private:
  void create(const std::string& header);
  bool read(const std::string& header);
  void readCount();
  void writeCount(std::size_t count) const;

  Journal journal_;
  std::vector<std::string> records_;
  std::vector<std::int64_t> starts_;  ///< of the records in the file
  bool torn_ = false;
  std::size_t lost_ = 0;
};

}  // namespace assembly_cell
