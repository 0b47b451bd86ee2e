// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Runs for the commands of the tool records: of a store, or curves in files.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "assembly_cell/base/options.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/records/charts.h"
#include "assembly_cell/records/run.h"
#include "commands.h"

namespace assembly_cell {

/// Its part of a help text, above kFilterHelp.
constexpr const char* kSourceHelp =
    R"(  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --runs IDS             of the store: 7 or 3-9, several with commas
  --curves PATH          instead of a store: a CSV file or a folder of curves, several times; see records import --help
  --time-unit U          of t in such files: s, ms, us or ns (default auto)
)";

/// Options of a command that goes through runs: --store, --runs, --curves, --time-unit and those of
/// FilterOptions.
class RunSource {
 public:
  RunSource(OptionParser& parser, std::int64_t limit);

  /// Value of --program. Throws InputError where it is missing.
  std::string program() const;
  /// Every run in the order of time, one at a time, those of files with the number in that order as
  /// id. Progress of more than 1000 goes to standard error. Returns their number; throws InputError
  /// for none.
  std::size_t each(const std::function<void(Run&)>& use);

 private:
  std::vector<std::int64_t> select(const RunStore& store) const;
  std::size_t eachOfStore(const std::function<void(Run&)>& use);
  std::size_t eachOfFiles(const std::function<void(Run&)>& use);

  OptionParser& parser_;
  StoreOption store_;
  FilterOptions filter_;
  std::vector<std::string> curves_;
  std::vector<std::pair<std::int64_t, std::int64_t>> ids_;  // first and last
  TimeUnit unit_ = TimeUnit::kFound;
};

/// Runs of CSV files and folders, in the order given.
std::vector<Run> readCurves(const std::vector<std::string>& paths, TimeUnit unit);

/// peak_force, seating_depth, cycle_time or an estimate of a run, as RunStore::trend() has it; NaN:
/// the run hasn't it.
double trendValue(const Run& run, const std::string& quantity);

/// Options of a control chart, and their part of a help text.
constexpr const char* kChartHelp =
    R"(  --lambda X             weight of the newest value in the moving average (0.1)
  --width L              of its limits, in its standard deviations (2.814: without drift one false alarm in 500 runs)
  --baseline N           runs at the begin that set mean and standard deviation (25)
)";
void declareChart(OptionParser& parser, EwmaSettings& settings);

}  // namespace assembly_cell
