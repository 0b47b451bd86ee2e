// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Random scenes by the thousand, see test/stress/random_scene.h. Prints what is wrong and the
// worst.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>

#include "../test/stress/random_scene.h"
#include "assembly_cell/base/input_error.h"

int main(int argc, char** argv) {
  using namespace assembly_cell;
  int scenes = 1000, first = 1;
  double duration = 0.05;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--scenes") == 0) scenes = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--seed") == 0) first = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--duration") == 0) duration = std::atof(argv[i + 1]);
  }
  if (argc % 2 == 0 || scenes < 1 || first < 0 || !(duration > 0.0)) {
    std::fprintf(stderr, "usage: stress [--scenes N] [--seed FIRST] [--duration SECONDS]\n");
    return 2;
  }
  const Scenario base =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  std::map<std::string, int> reasons;
  stress::Verdict gain, slow;
  int gain_seed = 0, slow_seed = 0, wrong = 0;
  for (int seed = first; seed < first + scenes; ++seed) {
    const stress::RandomScene random(base, static_cast<unsigned>(seed));
    stress::Verdict v;
    try {
      v = stress::run(random, duration);
    } catch (const InputError&) {
      ++reasons["refused"];
      continue;
    }
    ++reasons[v.reason];
    if (!v.finite || v.hung || !(v.gain < 1.0) || v.reason == "unknown") {
      ++wrong;
      std::printf("seed %d: %s, %s%s%s, gain %.1e, %.0f evaluations\n", seed, v.scene.c_str(),
                  v.reason.c_str(), v.finite ? "" : ", not finite", v.hung ? ", hung" : "", v.gain,
                  v.evaluations);
    }
    if (v.gain > gain.gain) gain = v, gain_seed = seed;
    if (v.evaluations > slow.evaluations) slow = v, slow_seed = seed;
  }
  for (const auto& [reason, count] : reasons) std::printf("%6d %s\n", count, reason.c_str());
  std::printf(
      "worst energy gain %.1e of what the tolerance allows (seed %d, %s)\nmost evaluations %.0f "
      "(seed %d, %s)\n%d wrong\n",
      gain.gain, gain_seed, gain.scene.c_str(), slow.evaluations, slow_seed, slow.scene.c_str(),
      wrong);
  return wrong > 0 ? 1 : 0;
}
