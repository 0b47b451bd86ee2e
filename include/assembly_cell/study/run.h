// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/study/study.h"

namespace assembly_cell {

/// A finished run.
struct StudyRecord {
  std::int64_t run = 0;
  bool failed = false;  ///< ended by anything but its duration or success
  bool assembled = false;
  double objective = kStudyNone;  ///< the searched outcome; NaN: undefined
  std::string row;                ///< of results.csv, without the end of line
  std::string history;            ///< lines of history.csv
};

/// One line and the payload; decodeRecord() gives the bytes it took, 0 for what is no record.
std::string encodeRecord(const StudyRecord& record);
std::size_t decodeRecord(const char* text, std::size_t size, StudyRecord& record);

/// Outcomes of a job, in the order of their columns.
const std::vector<std::string>& outcomeNames(StudyJob::Kind kind);

std::string resultsHeader(const Study& study);
std::string historyHeader();

/// Does the runs of a study, one after the other. The result depends on study and task alone.
class StudyRunner {
 public:
  explicit StudyRunner(const Study& study) : study_(study) {}
  /// Never throws for what a run does: that is its row's status and reason.
  StudyRecord run(const StudyTask& task);

 private:
  Scenario scenarioOf(const std::vector<StudySetting>& settings, StudyJob& job);

  const Study& study_;
  // the last scenario that was parsed
  std::string parsed_key_;
  Scenario parsed_;
};

}  // namespace assembly_cell
