// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/base/journal.h"
#include "assembly_cell/study/run.h"

namespace assembly_cell {

/// The file of finished runs. Only grows; survives the end of the process at any time: a record
/// that was cut off is cut off at the next start.
class StudyJournal {
 public:
  /// Opens or begins the journal, alone (other processes are refused). Throws InputError: not
  /// writable, in use, begun by another study or program (unless `fresh`, which starts again).
  StudyJournal(const std::string& path, const std::string& header, bool fresh);
  ~StudyJournal();

  /// All records that were there at the start, with their places.
  void read(const std::function<void(const StudyRecord&, std::int64_t place)>& visit);
  /// Place of the new record.
  std::int64_t append(const StudyRecord& record);
  StudyRecord at(std::int64_t place) const;
  void sync() const;

 private:
  Journal journal_;
  std::int64_t begin_ = 0;
};

/// Who does which run, what is done, when it is enough, and the files at the end. Thread-safe.
class StudyLedger {
 public:
  /// Results go to `folder`. Continues what is there of the same study.
  StudyLedger(const Study& study, const std::string& folder, bool fresh);

  /// Search: the runs of the next point may be taken. Returns the point's number.
  std::int64_t offer(const std::vector<double>& point);
  /// Mean of the objective over a point's runs, all of which must be done.
  double objective(std::int64_t point) const;
  /// A run of the point has a value of its own, not `otherwise`.
  bool valued(std::int64_t point) const;
  /// Search: no points follow.
  void close();

  /// The next run that is neither done nor taken; false when there is none now.
  bool take(StudyTask& task);
  void put(const StudyRecord& record);
  /// Runs that may still be taken, about.
  std::int64_t waiting() const;
  /// Every run that was offered is done.
  bool settled() const;

  struct Count {
    std::int64_t total = 0, done = 0, before = 0;  ///< before: done when this ledger was opened
    std::int64_t failed = 0, assembled = 0;        ///< of the done ones
  };
  Count count() const;

  /// Writes results.csv, history.csv and manifest.yaml; returns the number of rows by status.
  std::map<std::string, std::int64_t> finish();
  std::string resultsPath() const { return folder_ + "/results.csv"; }
  std::string historyPath() const { return folder_ + "/history.csv"; }

 private:
  void note(const StudyRecord& record, std::int64_t place);
  void settle();
  void writeManifest(const std::map<std::string, std::int64_t>* statuses) const;

  const Study& study_;
  const std::string folder_;
  mutable std::mutex mutex_;
  std::vector<std::int64_t> place_;  // of each run in the journal, -1: not done
  std::vector<std::uint8_t> flags_;  // 1 failed, 2 assembled
  std::vector<double> objective_;    // search only
  std::vector<std::vector<double>> points_;
  std::int64_t next_ = 0;     // first run that may be free
  std::int64_t offered_ = 0;  // runs below may be taken
  std::int64_t total_ = 0;
  std::int64_t prefix_ = 0;  // runs below are done and counted
  std::int64_t prefix_failed_ = 0, prefix_assembled_ = 0;
  Count count_;
  std::chrono::steady_clock::time_point synced_;
  StudyJournal journal_;
};

/// Does what the ledger offers with `threads` threads, until nothing is left or `stop`. Rethrows
/// what putting a record throws.
void runThreads(const Study& study, StudyLedger& ledger, int threads,
                const std::atomic<bool>& stop);

/// The best point of a search; `execute` does what the ledger offers, `stop` ends the search.
struct StudyOptimum {
  bool complete = false;
  std::vector<double> point;  ///< values of the axes of kind kSearch; empty: no point has a value
  double value = kStudyNone;
  std::int64_t evaluations = 0, number = 0;  ///< number: of the best point
};
StudyOptimum searchOptimum(const Study& study, StudyLedger& ledger,
                           const std::function<void()>& execute, const std::atomic<bool>& stop);
/// Value of a search axis from its number in 0 to 1.
double searchValue(const StudyAxis& axis, double unit);

}  // namespace assembly_cell
