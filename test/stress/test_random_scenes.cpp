// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Random scenes by the hundred: no crash, hang, NaN or energy gain; a run ends ok or with a named
// reason. The environment variable ASSEMBLY_CELL_STRESS_SCENES asks for more (default 250, 120 with
// a chamfer).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "random_scene.h"

namespace assembly_cell {
namespace {

// a chamfer of a thousandth to a tenth of the radius, at any angle
void addChamfer(unsigned seed, Scenario& s) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  HoleParameters& hole = s.mechanism.hole;
  hole.chamfer_angle = kLeastChamferAngle + (kMostChamferAngle - kLeastChamferAngle) * unit(random);
  hole.chamfer_width = std::min(hole.radius * std::pow(10.0, -3.0 + 2.0 * unit(random)),
                                0.5 * hole.depth * std::tan(hole.chamfer_angle));
}

void runScenes(int scenes, bool chamfered) {
  const Scenario base =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  std::map<std::string, int> reasons;
  stress::Verdict gain, slow;
  int gain_seed = 0, slow_seed = 0;
  for (int seed = 1; seed <= scenes; ++seed) {
    stress::RandomScene random(base, static_cast<unsigned>(seed));
    if (chamfered) addChamfer(static_cast<unsigned>(seed), random.scene);
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

int wanted(int usual) {
  const char* const wish = std::getenv("ASSEMBLY_CELL_STRESS_SCENES");
  return wish != nullptr ? std::max(1, std::atoi(wish)) : usual;
}

TEST(Stress, RandomScenes) { runScenes(wanted(250), false); }
TEST(Stress, RandomScenesWithAChamfer) { runScenes(wanted(120), true); }

}  // namespace
}  // namespace assembly_cell
