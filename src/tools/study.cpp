// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Does the runs of a study on all cores, or on several machines under mpirun.

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/base/heartbeat.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/study/ledger.h"
#include "assembly_cell/study/share.h"
#include "study/ranks.h"

namespace {

using assembly_cell::InputError;
using assembly_cell::Ranks;
using assembly_cell::Study;
using assembly_cell::StudyLedger;
using assembly_cell::StudyOptimum;
using assembly_cell::yamlNumber;
using assembly_cell::yamlQuoted;
using Clock = std::chrono::steady_clock;

constexpr const char* kHelp =
    R"(Usage: study STUDY.yaml [options]

Does all runs that a study describes and writes results.csv, manifest.yaml and, where the study has it, history.csv.
A study that was ended at any time goes on where it was with the same command.

  --output FOLDER       of the results (default results/<name of the file>)
  --threads N           runs at the same time (default: the cores; under mpirun 1 a rank)
  --fresh               drop the runs in the folder
  --mismatch FILE.yaml  how the truth of every run differs from its scenario, see docs/reference/mismatch.md; the same as
                        the study's key mismatch
  --set KEY.PATH=VALUE  change a value of the study: samples=100, axes[0].range.count=5; repeatable
  --list                print the runs instead of doing them: number, seed and axes as CSV
  --quiet               no progress
  --help                print this

Under mpirun the ranks share the runs; results do not depend on threads and ranks.
Exit code: 0 complete, 1 a search whose outcome no run has, 2 bad input, 130 or 143 ended by a signal (what is done is kept).

Example: study config/studies/exciting_force.yaml
         mpirun -n 4 study config/studies/success_misalignment.yaml --output map
)";

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

// the first signal ends after the present runs, the second at once
void onSignal(int number) {
  stop_requested = true;
  stop_signal = number;
  std::signal(number, SIG_DFL);
}

struct Options {
  std::string study, output;
  std::vector<std::string> overrides;
  long threads = 0;
  bool fresh = false, list = false, quiet = false;
};

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  assembly_cell::OptionParser parser(kHelp);
  parser.file("study", o.study);
  parser.flag("--fresh", o.fresh);
  parser.flag("--list", o.list);
  parser.flag("--quiet", o.quiet);
  parser.text("--output", o.output);
  parser.texts("--set", o.overrides);
  // the study's key is seen from its folder
  parser.value("--mismatch", "", [&o](const std::string& value) {
    const std::string path = std::filesystem::absolute(value).lexically_normal().string();
    o.overrides.push_back("mismatch=" + assembly_cell::yamlQuoted(path));
    return true;
  });
  parser.integer("--threads", o.threads, 1, 1024);
  if (!parser.parse(arguments)) return false;
  if (o.output.empty()) {
    o.output = "results/" + std::filesystem::path(o.study).stem().string();
  }
  return true;
}

// A bar on a terminal, a line every five seconds elsewhere.
class Progress {
 public:
  Progress(const StudyLedger& ledger, bool quiet) : ledger_(ledger) {
    if (quiet) return;
    const auto pause = terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(5);
    beat_ = std::make_unique<assembly_cell::Heartbeat>(pause, [this](double) { show(); });
  }
  ~Progress() {
    beat_.reset();
    if (shown_ && terminal_) std::cerr << "\n";
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  void show() {
    const StudyLedger::Count count = ledger_.count();
    const double rate = static_cast<double>(count.done - count.before) / seconds();
    constexpr int kWidth = 30;
    const double share =
        count.total > 0 ? static_cast<double>(count.done) / static_cast<double>(count.total) : 1.0;
    const int filled = static_cast<int>(kWidth * share);
    std::string line =
        assembly_cell::text("study: [%s%s] %ld of %ld runs, %.3g/s, ",
                            std::string(static_cast<std::size_t>(filled), '#').c_str(),
                            std::string(static_cast<std::size_t>(kWidth - filled), '-').c_str(),
                            static_cast<long>(count.done), static_cast<long>(count.total), rate);
    if (rate > 0.0) {
      line += remaining(static_cast<double>(count.total - count.done) / rate) + " left";
    } else {
      line += "time left unknown";
    }
    if (count.failed > 0) line += ", " + std::to_string(count.failed) + " failed";
    if (terminal_) {
      std::cerr << "\r" << line << "\x1b[K" << std::flush;
    } else {
      std::cerr << line << std::endl;
    }
    shown_ = true;
  }

  static std::string remaining(double seconds) {
    const long s = std::lround(std::min(seconds, 1e9));
    if (s < 90) return std::to_string(s) + " s";
    if (s < 5400) return std::to_string(s / 60) + " min";
    return std::to_string(s / 3600) + " h " + std::to_string(s / 60 % 60) + " min";
  }

  const StudyLedger& ledger_;
  const bool terminal_ = isatty(STDERR_FILENO) != 0;
  const Clock::time_point start_ = Clock::now();
  bool shown_ = false;
  std::unique_ptr<assembly_cell::Heartbeat> beat_;
};

void printList(const Study& study) {
  std::cout << "run,seed";
  for (const auto& axis : study.axes) std::cout << "," << axis.name;
  std::cout << "\n";
  for (std::int64_t run = 0; run < assembly_cell::runsPerPoint(study); ++run) {
    const assembly_cell::StudyRun plan = studyRun(study, {run, {}});
    std::cout << run << "," << plan.seed;
    for (const std::string& label : plan.labels) std::cout << "," << label;
    std::cout << "\n";
  }
  assembly_cell::checkStandardOutput();
}

void printSummary(const Study& study, const StudyLedger& ledger, const StudyOptimum& optimum,
                  const std::map<std::string, std::int64_t>& statuses, double seconds) {
  const StudyLedger::Count count = ledger.count();
  std::cout << "study: " << yamlQuoted(study.name) << "\n"
            << "runs: " << count.total << "\n"
            << "done_before: " << std::min(count.before, count.total) << "\n"
            << "statuses: {";
  std::string separator;
  for (const auto& [name, number] : statuses) {
    std::cout << separator << yamlQuoted(name) << ": " << number;
    separator = ", ";
  }
  std::cout << "}\n";
  const auto whole = [](const std::string& name) {
    return name == "ok" || name == "assembled" || name == "aligned";
  };
  std::int64_t early = 0;
  for (const auto& [name, number] : statuses) early += whole(name) ? 0 : number;
  if (early > 0) {
    std::cout << "# " << early << " of " << count.total
              << " runs ended early, by what their status names; their rows have the reason\n";
  }
  const assembly_cell::ShareInterval share =
      assembly_cell::shareInterval(count.assembled, count.total);
  if (!study.evaluated) {
    std::cout << "assembled: null\n";
  } else {
    std::cout << "assembled: {runs: " << count.assembled << ", share: " << yamlNumber(share.share)
              << ", interval: [" << yamlNumber(share.low) << ", " << yamlNumber(share.high)
              << "]}\n";
  }
  if (!study.search.outcome.empty() && optimum.point.empty()) {
    std::cout << "optimum: null\n";
  } else if (!study.search.outcome.empty()) {
    std::cout << "optimum:\n  " << study.search.outcome << ": " << yamlNumber(optimum.value)
              << "\n";
    std::size_t i = 0;
    for (const auto& axis : study.axes) {
      if (axis.kind != assembly_cell::StudyAxis::Kind::kSearch) continue;
      std::cout << "  " << axis.name << ": " << yamlNumber(optimum.point.at(i++)) << "\n";
    }
    std::cout << "  evaluations: " << optimum.evaluations
              << "\n  first_run: " << optimum.number * assembly_cell::runsPerPoint(study) << "\n";
  }
  std::cout << "results: " << yamlQuoted(ledger.resultsPath()) << "\n"
            << "wall_time: " << yamlNumber(seconds) << "\n";
  assembly_cell::checkStandardOutput();
}

// Rank 0, or the only process.
int lead(const Options& o, const Study& study, Ranks* ranks) {
  StudyLedger ledger(study, o.output, o.fresh);
  if (!o.quiet) std::cerr << "study: results go to " << o.output << " (see --output)\n";
  StudyOptimum optimum;
  double seconds = 0.0;
  {
    Progress progress(ledger, o.quiet);
    const auto execute = [&] {
      if (ranks != nullptr && ranks->size() > 1) {
        ranks->serve(study, ledger, static_cast<int>(o.threads), stop_requested);
      } else {
        runThreads(study, ledger, static_cast<int>(o.threads), stop_requested);
      }
    };
    if (study.search.outcome.empty()) {
      execute();
      optimum.complete = ledger.settled();
    } else {
      optimum = searchOptimum(study, ledger, execute, stop_requested);
    }
    seconds = progress.seconds();
  }
  if (!optimum.complete) {
    const StudyLedger::Count count = ledger.count();
    std::cerr << "study: ended after " << count.done << " of " << count.total
              << " runs; they are kept in " << o.output << ", the same command goes on from there"
              << std::endl;
    return 128 + std::max(1, stop_signal.load());
  }
  const auto statuses = ledger.finish();
  printSummary(study, ledger, optimum, statuses, seconds);
  if (study.search.outcome.empty() || !optimum.point.empty()) return 0;
  std::cerr << "study: search: no run has the outcome " << study.search.outcome
            << ", so nothing is an optimum: see the reasons in " << ledger.resultsPath() << "\n";
  return 1;
}

int run(Options o, Ranks* ranks) {
  if (o.threads == 0) o.threads = ranks != nullptr ? 1 : omp_get_num_procs();
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  Study study;
  std::string problem;
  try {
    study = assembly_cell::loadStudy(o.study, o.overrides);
  } catch (const InputError& e) {
    problem = e.what();
  }
  if (ranks != nullptr) {
    const std::string mine = study.digest + assembly_cell::packageBuild();
    if (!ranks->agree(mine, problem.empty()) && problem.empty()) {
      problem = o.study + ": study: not the same on all ranks: give all of them the same files " +
                "and the same program";
    }
  }
  if (!problem.empty()) throw InputError(problem);
  if (o.list) {
    if (ranks == nullptr || ranks->rank() == 0) printList(study);
    return 0;
  }
  if (ranks == nullptr) return lead(o, study, nullptr);
  if (ranks->rank() != 0) {
    ranks->work(study, static_cast<int>(o.threads), stop_requested);
    return 0;
  }
  try {
    const int code = lead(o, study, ranks);
    ranks->release();
    return code;
  } catch (...) {
    ranks->release();
    throw;
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::unique_ptr<Ranks> ranks;
  try {
    Options options;
    if (!parseOptions({argv + 1, argv + argc}, options)) return 0;
    if (Ranks::launched()) ranks = std::make_unique<Ranks>();
    return run(options, ranks.get());
  } catch (const std::exception& e) {
    // all ranks have the same message
    if (!ranks || ranks->rank() == 0) std::cerr << "study: " << e.what() << std::endl;
    return 2;
  }
}
