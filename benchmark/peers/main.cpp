// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The same scenes through the package and through other engines, in one run: which reaches an error
// for which time. See benchmark/README.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "peer.h"

namespace assembly_cell::peers {
namespace {

std::vector<Setting> settingsOf(const Scene& scene) {
  std::vector<Setting> all = packageSettings(scene);
  const auto add = [&all](const std::vector<Setting>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  add(odeintSettings(scene));
#ifdef ASSEMBLY_CELL_MUJOCO
  add(mujocoSettings(scene));
#endif
#ifdef ASSEMBLY_CELL_ODE
  add(odeSettings(scene));
#endif
  return all;
}

// the cheapest that is no worse than the error asked for; the most accurate where none is
const Outcome* best(const std::vector<Outcome>& all, const std::string& engine, double error) {
  const Outcome* found = nullptr;
  for (const Outcome& o : all) {
    if (o.engine != engine || !std::isfinite(o.error)) continue;
    const bool reached = o.error <= error;
    const bool had = found != nullptr && found->error <= error;
    if (found == nullptr || (reached && (!had || o.seconds < found->seconds)) ||
        (!reached && !had && o.error < found->error)) {
      found = &o;
    }
  }
  return found;
}

void table(const Scene& scene, const std::vector<Outcome>& all) {
  std::printf("\n### %s\n\n%g s of `%s`; the reference's own error is %.1g mm.\n\n",
              scene.name.c_str(), scene.duration, scene.scenario.name.c_str(),
              1e3 * scene.truth_sd);
  std::printf(
      "| at an error of | engine | how | error [mm] | CPU ms a simulated second | of ours |\n"
      "|---|---|---|---|---|---|\n");
  const std::vector<double> errors = scene.touching ? std::vector<double>{1e-5, 1e-6, 1e-9}
                                                    : std::vector<double>{1e-6, 1e-9, 1e-12};
  for (const double error : errors) {
    const Outcome* ours = best(all, "assembly_cell", error);
    for (const char* engine : {"assembly_cell", "Boost.Odeint", "MuJoCo", "ODE"}) {
      const Outcome* o = best(all, engine, error);
      if (o == nullptr) continue;
      std::printf("| %g mm | %s | %s | %.1e%s | %.2f | %.2f |\n", 1e3 * error, engine,
                  o->how.c_str(), 1e3 * o->error, o->error <= error ? "" : ", not reached",
                  1e3 * o->seconds, o->seconds / ours->seconds);
    }
  }
}

int run(int argc, char** argv) {
  int repeats = 5;
  bool every = false;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--repeats" && i + 1 < argc) {
      repeats = std::max(1, std::atoi(argv[++i]));
    } else if (argument == "--all") {
      every = true;
    } else {
      std::fprintf(stderr,
                   "usage: bench_peers [--repeats N] [--all]    --all: each setting's row as CSV "
                   "on standard error\n");
      return argument == "--help" ? 0 : 2;
    }
  }
  for (const Scene& scene : scenes()) {
    std::vector<Outcome> all;
    for (const Setting& setting : settingsOf(scene)) {
      all.push_back(measure(scene, setting, repeats));
      const Outcome& o = all.back();
      if (every) {
        std::fprintf(stderr, "%s,%s,\"%s\",%.3e,%.4e,%ld\n", scene.name.c_str(), o.engine.c_str(),
                     o.how.c_str(), o.error, o.seconds, o.steps);
      }
    }
    table(scene, all);
  }
  return 0;
}

}  // namespace
}  // namespace assembly_cell::peers

int main(int argc, char** argv) {
  try {
    return assembly_cell::peers::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_peers: %s\n", e.what());
    return 1;
  }
}
