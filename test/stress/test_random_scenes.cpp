// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Random scenes by the hundred: no crash, hang, NaN or energy gain; a run ends ok or with a named
// reason. The environment variable ASSEMBLY_CELL_STRESS_SCENES asks for more (default 250).
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <map>

#include "assembly_cell/base/input_error.h"
#include "random_scene.h"

namespace assembly_cell {
namespace {

TEST(Stress, RandomScenes) {
  const char* const wish = std::getenv("ASSEMBLY_CELL_STRESS_SCENES");
  const int scenes = wish != nullptr ? std::max(1, std::atoi(wish)) : 250;
  const Scenario base =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  std::map<std::string, int> reasons;
  stress::Verdict gain, slow;
  int gain_seed = 0, slow_seed = 0;
  for (int seed = 1; seed <= scenes; ++seed) {
    const stress::RandomScene random(base, static_cast<unsigned>(seed));
    stress::Verdict v;
    try {
      v = stress::run(random, 0.02);
    } catch (const InputError& e) {
      ++reasons["refused"];
      continue;
    }
    ++reasons[v.reason];
    EXPECT_TRUE(v.finite) << "seed " << seed << ", " << v.scene;
    EXPECT_FALSE(v.hung) << "seed " << seed << ", " << v.scene;
    EXPECT_NE(v.reason, "unknown") << "seed " << seed;
    EXPECT_LT(v.gain, 1.0) << "seed " << seed << ", " << v.scene << ", " << v.reason;
    if (v.gain > gain.gain) gain = v, gain_seed = seed;
    if (v.evaluations > slow.evaluations) slow = v, slow_seed = seed;
  }
  for (const auto& [reason, count] : reasons) std::printf("%6d %s\n", count, reason.c_str());
  std::printf(
      "worst energy gain %.1e of what the tolerance allows (seed %d, %s); most evaluations %.0f "
      "(seed %d, %s)\n",
      gain.gain, gain_seed, gain.scene.c_str(), slow.evaluations, slow_seed, slow.scene.c_str());
  // fixed steps beyond their stability give the only states that are not finite
  EXPECT_GT(reasons["ok"], scenes / 2);
}

}  // namespace
}  // namespace assembly_cell
