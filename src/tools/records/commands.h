// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The commands of the tool records. Each gets the arguments after its name, has a --help of its own
// and returns the exit code.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/options.h"
#include "assembly_cell/records/store.h"

namespace assembly_cell {

int listRuns(const std::vector<std::string>& arguments);
int showRun(const std::vector<std::string>& arguments);
int exportRuns(const std::vector<std::string>& arguments);
int checkStore(const std::vector<std::string>& arguments);
int trendOfRuns(const std::vector<std::string>& arguments);
int plotRun(const std::vector<std::string>& arguments);
int compareRuns(const std::vector<std::string>& arguments);
int learnRules(const std::vector<std::string>& arguments);
int evaluateRuns(const std::vector<std::string>& arguments);
int reportRuns(const std::vector<std::string>& arguments);
int importRuns(const std::vector<std::string>& arguments);

/// The option --store, of all commands: the file, or the default one.
class StoreOption {
 public:
  explicit StoreOption(OptionParser& parser) { parser.text("--store", path_); }
  const std::string& path();
  RunStore open(RunStore::Access access = RunStore::Access::kRead) { return {path(), access}; }

 private:
  std::string path_;
};

/// Options of commands that take many runs; their part of a help text.
constexpr const char* kFilterHelp =
    R"(  --serial S, --program P, --station S, --result R   only runs with that; results are seated, aligned, failed
  --passed, --failed     only runs whose verdicts all passed, or that one of them failed
  --from T, --to T       that began at T or later, before T: a date, 2026-11-29, or a time, 2026-11-29T04:30:00 (UTC)
)";
/// They and --limit, whose default is given.
class FilterOptions {
 public:
  FilterOptions(OptionParser& parser, std::int64_t limit);
  FilterOptions(const FilterOptions&) = delete;
  FilterOptions& operator=(const FilterOptions&) = delete;
  RunFilter filter() const;

 private:
  RunFilter filter_;
  bool passed_ = false, failed_ = false;
};

const std::vector<std::string> kFilterOptions{"--serial", "--program", "--station",
                                              "--result", "--passed",  "--failed",
                                              "--from",   "--to",      "--limit"};

/// CSV of a curve: a column for each channel that was measured.
std::string curveText(const Curve& curve);

/// The number of a run.
std::int64_t runNumber(const std::string& text);

/// A time since 1970 [s] as 2026-11-29T04:30:00Z.
std::string timeText(double time);

}  // namespace assembly_cell
