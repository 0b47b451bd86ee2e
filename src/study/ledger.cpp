// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/study/ledger.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <memory>
#include <sstream>
#include <system_error>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/study/share.h"

namespace assembly_cell {
namespace {

constexpr std::uint8_t kFailed = 1, kAssembled = 2;
constexpr std::chrono::seconds kSyncInterval(1);

std::string madeFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw InputError("--output: value " + folder + ": " + (error ? error.message() : "no folder") +
                     ", give a folder that can be made");
  }
  return folder;
}

// Files of other programs are not replaced.
std::string ownFolder(const std::string& folder, bool fresh) {
  namespace fs = std::filesystem;
  madeFolder(folder);
  if (fresh || fs::exists(folder + "/journal")) return folder;
  for (const char* name : {"/results.csv", "/history.csv", "/manifest.yaml"}) {
    if (!fs::exists(folder + name)) continue;
    throw InputError(
        "--output: value " + folder + ": its " + (name + 1) +
        " is of no study that can go on: give another folder, or --fresh to replace it");
  }
  return folder;
}

}  // namespace

StudyLedger::StudyLedger(const Study& study, const std::string& folder, bool fresh)
    : study_(study),
      folder_(ownFolder(folder, fresh)),
      synced_(std::chrono::steady_clock::now()),
      journal_(folder + "/journal", "study " + study.digest + " by " + packageBuild(), fresh) {
  total_ = runCount(study);
  const auto size = static_cast<std::size_t>(total_);
  place_.assign(size, -1);
  flags_.assign(size, 0);
  const bool search = !study.search.outcome.empty();
  if (search) objective_.assign(size, kStudyNone);
  offered_ = search ? 0 : total_;
  journal_.read([this](const StudyRecord& record, std::int64_t place) { note(record, place); });
  settle();
  count_.before = count_.done;
  // tables of other runs don't stay beside a study that isn't complete
  for (const std::string& path : {resultsPath(), historyPath()}) {
    std::error_code error;
    std::filesystem::remove(path, error);
  }
  writeManifest(nullptr);
}

void StudyLedger::note(const StudyRecord& record, std::int64_t place) {
  const auto run = static_cast<std::size_t>(record.run);
  if (record.run < 0 || run >= place_.size() || place_[run] >= 0) return;
  place_[run] = place;
  flags_[run] = static_cast<std::uint8_t>((record.failed ? kFailed : 0) |
                                          (record.assembled ? kAssembled : 0));
  if (!objective_.empty()) objective_[run] = record.objective;
  ++count_.done;
  count_.failed += record.failed ? 1 : 0;
  count_.assembled += record.assembled ? 1 : 0;
}

// The rule sees the runs in their order, so that it ends the study at the same run always.
void StudyLedger::settle() {
  const StudyEnough& enough = study_.enough;
  while (prefix_ < total_ && place_[static_cast<std::size_t>(prefix_)] >= 0) {
    const std::uint8_t flags = flags_[static_cast<std::size_t>(prefix_)];
    ++prefix_;
    prefix_failed_ += (flags & kFailed) != 0 ? 1 : 0;
    prefix_assembled_ += (flags & kAssembled) != 0 ? 1 : 0;
    const ShareInterval share = shareInterval(prefix_assembled_, prefix_);
    const bool narrow =
        prefix_ >= enough.min_runs && 0.5 * (share.high - share.low) <= enough.half_width;
    const bool failing = static_cast<double>(prefix_failed_) >= enough.failed;
    if (narrow || failing) total_ = offered_ = prefix_;
  }
}

std::int64_t StudyLedger::offer(const std::vector<double>& point) {
  const std::lock_guard<std::mutex> lock(mutex_);
  points_.push_back(point);
  offered_ += runsPerPoint(study_);
  return static_cast<std::int64_t>(points_.size()) - 1;
}

double StudyLedger::objective(std::int64_t point) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::int64_t runs = runsPerPoint(study_);
  double sum = 0.0;
  for (std::int64_t i = point * runs; i < (point + 1) * runs; ++i) {
    const double value = objective_[static_cast<std::size_t>(i)];
    sum += std::isnan(value) ? study_.search.otherwise : value;
  }
  return sum / static_cast<double>(runs);
}

bool StudyLedger::valued(std::int64_t point) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto runs = runsPerPoint(study_);
  const auto first = objective_.begin() + point * runs;
  return std::any_of(first, first + runs, [](double value) { return !std::isnan(value); });
}

void StudyLedger::close() {
  const std::lock_guard<std::mutex> lock(mutex_);
  total_ = offered_;
}

bool StudyLedger::take(StudyTask& task) {
  const std::lock_guard<std::mutex> lock(mutex_);
  while (next_ < offered_ && place_[static_cast<std::size_t>(next_)] >= 0) ++next_;
  if (next_ >= offered_) return false;
  task.run = next_++;
  task.point.clear();
  if (!points_.empty()) {
    task.point = points_[static_cast<std::size_t>(task.run / runsPerPoint(study_))];
  }
  return true;
}

void StudyLedger::put(const StudyRecord& record) {
  bool sync = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    note(record, journal_.append(record));
    settle();
    const auto now = std::chrono::steady_clock::now();
    sync = now - synced_ > kSyncInterval;
    if (sync) synced_ = now;
  }
  // the process may die at any time; this is for machines that do
  if (sync) journal_.sync();
}

bool StudyLedger::settled() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::int64_t run = prefix_; run < offered_; ++run) {
    if (place_[static_cast<std::size_t>(run)] < 0) return false;
  }
  return true;
}

std::int64_t StudyLedger::waiting() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::max<std::int64_t>(0, offered_ - next_);
}

StudyLedger::Count StudyLedger::count() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  Count count = count_;
  count.total = total_;
  count.done = std::min(count.done, total_);
  return count;
}

std::map<std::string, std::int64_t> StudyLedger::finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::size_t status = 2 + study_.axes.size();
  std::map<std::string, std::int64_t> statuses;
  const char* remedy = "give --output a folder that can be written, with free space";
  NewFile results(resultsPath(), "results " + resultsPath(), remedy);
  results.write(resultsHeader(study_) + "\n");
  std::unique_ptr<NewFile> history;
  if (study_.history) {
    history = std::make_unique<NewFile>(historyPath(), "results " + historyPath(), remedy);
    history->write(historyHeader() + "\n");
  }
  // runs beyond the end of the study don't count
  count_.done = total_;
  count_.failed = count_.assembled = 0;
  for (std::int64_t run = 0; run < total_; ++run) {
    const std::uint8_t flags = flags_[static_cast<std::size_t>(run)];
    count_.failed += (flags & kFailed) != 0 ? 1 : 0;
    count_.assembled += (flags & kAssembled) != 0 ? 1 : 0;
    const StudyRecord record = journal_.at(place_[static_cast<std::size_t>(run)]);
    results.write(record.row + "\n");
    if (history) history->write(record.history);
    ++statuses[std::string(csvCells(record.row).at(status))];
  }
  if (history) history->finish();
  results.finish();
  writeManifest(&statuses);
  return statuses;
}

void StudyLedger::writeManifest(const std::map<std::string, std::int64_t>* statuses) const {
  std::ostringstream out;
  out << "study: " << yamlQuoted(study_.name) << "\n"
      << "program: " << yamlQuoted(packageBuild()) << "\n"
      << "digest: \"" << study_.digest << "\"  # of study and scenarios\n"
      << "job: " << (study_.job.kind == StudyJob::Kind::kAlign ? "align" : "simulate") << "\n"
      << "scenarios:\n";
  for (std::size_t i = 0; i < study_.scenarios.size(); ++i) {
    out << "  - {file: "
        << yamlQuoted(std::filesystem::path(study_.scenarios[i]).filename().string())
        << ", digest: \"" << study_.digests[i] << "\"}\n";
  }
  out << "seed: " << study_.seed << "  # a run's own seed is in its row\n"
      << "samples: " << study_.samples << "\n"
      << "paired: " << (study_.paired ? "true" : "false") << "\n"
      << "axes: [";
  for (std::size_t i = 0; i < study_.axes.size(); ++i) {
    out << (i == 0 ? "" : ", ") << yamlQuoted(study_.axes[i].name);
  }
  out << "]\n"
      << "columns: [";
  std::string separator;
  const std::string header = resultsHeader(study_);
  for (const std::string_view name : csvCells(header)) {
    out << separator << yamlQuoted(std::string(name));
    separator = ", ";
  }
  out << "]  # SI units\n"
      << "complete: " << (statuses != nullptr ? "true" : "false") << "\n";
  if (statuses != nullptr) {
    out << "runs: " << total_ << "\n"
        << "statuses: {";
    separator.clear();
    for (const auto& [name, count] : *statuses) {
      out << separator << yamlQuoted(name) << ": " << count;
      separator = ", ";
    }
    out << "}\n";
  }
  const std::string path = folder_ + "/manifest.yaml";
  writeFileAtomically(path, out.str(), "manifest " + path);
}

void runThreads(const Study& study, StudyLedger& ledger, int threads,
                const std::atomic<bool>& stop) {
  std::exception_ptr problem;
  std::atomic<bool> broken{false};
#pragma omp parallel num_threads(threads)
  {
    try {
      StudyRunner runner(study);
      StudyTask task;
      while (!stop && !broken && ledger.take(task)) {
        ledger.put(runner.run(task));
      }
    } catch (...) {
#pragma omp critical
      problem = std::current_exception();
      broken = true;
    }
  }
  if (problem) std::rethrow_exception(problem);
}

}  // namespace assembly_cell
