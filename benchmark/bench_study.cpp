// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the tool `study` adds to the bare loop over the same runs, and what a second thread or rank
// brings. See benchmark/README.md.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/study/ledger.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

double cpuSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double wallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// CPU time of the children that have ended
double childSeconds() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct Cost {
  double wall = 1e300, cpu = 1e300;
  void take(double more_wall, double more_cpu) {
    wall = std::min(wall, more_wall);
    cpu = std::min(cpu, more_cpu);
  }
};

// The same runs without the tool: a number written into a copy of the scenario, construct, advance.
double bareLoop(const Study& study, double look) {
  double sum = 0.0;
  for (std::int64_t run = 0; run < runCount(study); ++run) {
    Scenario scenario = study.bases.front();
    for (const StudySetting& s : studyRun(study, {run, {}}).settings) {
      parseNumber(s.value, *scenarioNumber(scenario, s.key));
    }
    Simulation simulation(scenario);
    const double step = look > 0.0 ? look : scenario.duration;
    const auto looks = static_cast<int>(scenario.duration / step + 0.5);
    for (int i = 1; i <= looks; ++i) simulation.advance(scenario.duration * i / looks);
    sum += simulation.state().q[0];
  }
  return sum;
}

// what the tool prints as its own, without the start of the processes [s]
double wallTimeOf(const std::string& summary) {
  std::ifstream file(summary);
  const std::string key = "wall_time: ";
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(key, 0) == 0) return std::stod(line.substr(key.size()));
  }
  throw std::runtime_error(summary + ": no wall_time");
}

int run(int argc, char** argv) {
  const long runs = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 1000;
  const long repeats = argc > 2 ? std::strtol(argv[2], nullptr, 10) : 5;
  if (runs < 10 || repeats < 1) {
    std::fprintf(stderr, "bench_study: usage: bench_study [RUNS >= 10 [REPEATS >= 1]]\n");
    return 2;
  }
  const std::string file =
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/studies/vibrated_runs.yaml";
  const std::string samples = "samples=" + std::to_string(runs);
  const Study study = loadStudy(file, {samples});
  const fs::path folder = fs::temp_directory_path() / ("bench_study_" + std::to_string(getpid()));
  const std::string out = (folder / "out").string();

  Cost bare, looked, tool, two;
  double sink = 0.0;
  for (long k = 0; k < repeats; ++k) {
    const auto measure = [](Cost& cost, const auto& what) {
      const double wall = wallSeconds(), cpu = cpuSeconds();
      what();
      cost.take(wallSeconds() - wall, cpuSeconds() - cpu);
    };
    const std::atomic<bool> stop{false};
    const auto study_with = [&](int threads) {
      StudyLedger ledger(study, out, true);
      runThreads(study, ledger, threads, stop);
      ledger.finish();
    };
    measure(bare, [&] { sink += bareLoop(study, 0.0); });
    measure(looked, [&] { sink += bareLoop(study, study.job.look); });
    measure(tool, [&] { study_with(1); });
    measure(two, [&] { study_with(2); });
  }
  const auto per_run = [&](double seconds) { return 1e3 * seconds / static_cast<double>(runs); };
  std::printf("%ld runs of 0.15 s, fastest of %ld; sum of heights %.6f m\n", runs, repeats,
              sink / static_cast<double>(repeats) / 2);
  std::printf("%-44s %10s %10s\n", "", "CPU ms/run", "wall ms/run");
  const auto line = [&](const char* name, const Cost& cost) {
    std::printf("%-44s %10.3f %10.3f\n", name, per_run(cost.cpu), per_run(cost.wall));
  };
  line("bare loop, one advance a run", bare);
  line("bare loop, advanced from look to look", looked);
  line("study, 1 thread, with journal and results", tool);
  line("study, 2 threads", two);
  std::printf("overhead over the bare loop: %+.1f %% (of it %+.1f %% for looking every %g ms)\n",
              100 * (tool.cpu / bare.cpu - 1), 100 * (looked.cpu / bare.cpu - 1),
              1e3 * study.job.look);
  std::printf("2 threads: %.2f times as fast (CPU time %+.1f %%)\n", tool.wall / two.wall,
              100 * (two.cpu / tool.cpu - 1));

  // ranks: whole processes, started by mpirun
  const fs::path here = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& place : {here, here / "devel/lib/assembly_cell"}) {
    if (!fs::exists(place / "study")) continue;
    const std::string summary = (folder / "summary.yaml").string();
    const std::string call = "'" + (place / "study").string() + "' '" + file + "' --set " +
                             samples + " --quiet --fresh --output '" + out + "' > '" + summary +
                             "'";
    Cost process[3];
    for (long k = 0; k < repeats; ++k) {
      for (const int ranks : {1, 2}) {
        const std::string command =
            "mpirun --allow-run-as-root --oversubscribe -n " + std::to_string(ranks) + " " + call;
        const double cpu = childSeconds();
        if (std::system(command.c_str()) != 0) {
          std::fprintf(stderr, "bench_study: failed: %s\n", command.c_str());
          return 1;
        }
        process[ranks].take(wallTimeOf(summary), childSeconds() - cpu);
      }
    }
    line("mpirun -n 1, CPU time with its start", process[1]);
    line("mpirun -n 2", process[2]);
    std::printf("2 ranks: %.2f times as fast\n", process[1].wall / process[2].wall);
    break;
  }
  fs::remove_all(folder);
  return 0;
}

}  // namespace
}  // namespace assembly_cell

int main(int argc, char** argv) {
  try {
    return assembly_cell::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_study: %s\n", e.what());
    return 2;
  }
}
