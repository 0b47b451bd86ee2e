// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include "assembly_cell/align/align.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/scene/scenario.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;

AlignTrial baselineTrial(const char* strategy, const Vector2d& offset, const Vector2d& tilt) {
  const Scenario s = cell();
  AlignParameters p;
  p.strategy = strategy;
  return tryAlignment(startAt(s, offset, tilt, 0.003), s.mechanism, CellParameters{}, p);
}

// Some ten turns from the start to the hole, at a tilt that the touches have to take out. With 5 N
// at 10 mm/s the peg sprang over the hole of the second start.
TEST(Baselines, SpiralDropsIn) {
  const Vector2d starts[][2] = {{{0.0012, -0.0009}, {0.01, -0.012}},
                                {{-0.00158, 0.00109}, {-0.0023, 0.0266}}};
  for (const auto& start : starts) {
    const AlignTrial trial = baselineTrial("spiral", start[0], start[1]);
    EXPECT_TRUE(trial.success) << trial.result.reason;
    // known as well as the walls tell: a fifth of the clearance
    EXPECT_LT((trial.result.offset - trial.true_offset).norm(), 2e-5);
    EXPECT_LT(trial.force, 20.0);
  }
}

// A face without a hole within reach: the search ends by name.
TEST(Baselines, SpiralReportsThatThereIsNoHole) {
  AlignParameters p;
  p.strategy = "spiral";
  Scenario s = cell();
  s.mechanism.hole.radius = 0.0256;  // wide turns: 0.8 mm
  const AlignTrial trial =
      tryAlignment(startAt(s, {0.06, 0.0}, {0.005, 0.0}, 0.003), s.mechanism, CellParameters{}, p);
  EXPECT_FALSE(trial.success);
  EXPECT_EQ(trial.result.failure, AlignFailure::kNoHoleUnderEdge) << trial.result.reason;
}

// Within the clearance shaking and lowering assemble; farther off the peg is on the face, and the
// strategy reports it.
TEST(Baselines, PassiveNeedsAHoleBelow) {
  const AlignTrial near = baselineTrial("passive", {2e-5, 1e-5}, {5e-4, 0.0});
  EXPECT_TRUE(near.success) << near.result.reason;
  const AlignTrial far = baselineTrial("passive", {0.003, 0.001}, {0.01, 0.01});
  EXPECT_FALSE(far.success);
  EXPECT_FALSE(far.false_success);
  EXPECT_EQ(far.result.failure, AlignFailure::kForceLimit) << far.result.reason;
}

}  // namespace
}  // namespace assembly_cell
