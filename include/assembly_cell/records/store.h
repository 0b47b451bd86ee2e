// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/records/run.h"

namespace assembly_cell {

/// Which runs; an empty or unset field restricts nothing.
struct RunFilter {
  std::string serial, program, station, result;
  std::optional<bool> passed;  ///< all verdicts passed; a run without a verdict is neither
  double from = -std::numeric_limits<double>::infinity();  ///< start, since 1970 [s]
  double to = std::numeric_limits<double>::infinity();     ///< before
  std::int64_t limit = 0;                                  ///< the latest so many; 0: all
};

/// A row of a list of runs, latest first.
struct RunSummary {
  std::int64_t id = 0;
  std::string serial, program, station, strategy, result, failure;
  double start = 0.0, duration = 0.0;  ///< [s]
  double peak_force = 0.0;             ///< largest axial force of the curve; NaN: no curve [N]
  double seating_depth = 0.0;          ///< depth at the curve's end; NaN: none [m]
  int verdicts = 0, failed = 0;        ///< number of verdicts, of those not passed
};

/// A number of each run, in the order of time.
struct TrendPoint {
  std::int64_t id = 0;
  double start = 0.0;  ///< since 1970 [s]
  double value = 0.0;
};

/// ~/.ros/assembly_cell/records.db, or below ROS_HOME where that is set. Throws InputError when
/// neither HOME nor ROS_HOME is.
std::string defaultRunStore();

/// A store of runs: one SQLite file in WAL mode. One transaction a run: what append() has returned
/// for is there whole, whatever ends the process or the machine afterwards. Several processes may
/// write; an object is for one thread at a time. Every refusal is an InputError, one line that
/// names the file.
class RunStore {
 public:
  enum class Access { kRead, kWrite };

  /// Opens the file; with kWrite makes it where there is none, its folder too. A store of an older
  /// schema is brought up to date. Throws InputError: missing, unreadable, no store, corrupt, of a
  /// newer schema, and with kWrite read-only.
  RunStore(const std::string& path, Access access);
  ~RunStore();
  RunStore(RunStore&&) noexcept;
  RunStore& operator=(RunStore&&) noexcept;

  /// Throws InputError unless a run could be written now: a full disk, a store made read-only, one
  /// that another program has locked for 1 s, a file that was removed or replaced meanwhile.
  void checkWritable();
  /// Stores the run, gives it its id and, where it has none, its serial: "run-" and the id. Throws
  /// InputError, with nothing stored: as checkWritable(), and for numbers that aren't finite but
  /// those that may be NaN: margin and depth of a verdict, and a channel of the curve that was not
  /// measured at all, never all of time and depth nor the axial force.
  void append(Run& run);

  /// Throws InputError where there is none.
  Run read(std::int64_t id) const;
  std::vector<RunSummary> list(const RunFilter& filter) const;
  /// quantity: peak_force [N], seating_depth [m], cycle_time [s], or the name of an estimate.
  /// Runs without it are left out. Throws InputError for one that no run has.
  std::vector<TrendPoint> trend(const std::string& quantity, const RunFilter& filter) const;
  /// What is wrong with the file, each in a line; empty: nothing. progress: fraction done.
  std::vector<std::string> check(const std::function<void(double)>& progress = nullptr) const;

 private:
  struct Database;
  std::unique_ptr<Database> database_;
};

}  // namespace assembly_cell
