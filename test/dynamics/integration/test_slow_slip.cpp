// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Slow slip: the cell's peg, pressed on the plane and vibrated, sticks and slips twice a turn.
// Friction turns there at 1e6 1/s. Steps still follow the motion, and errors the
// tolerance.
#include <gtest/gtest.h>

#include "assembly_cell/dynamics/simulation.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

struct End {
  Eigen::Vector3d place;
  std::int64_t evaluations = 0, steps = 0, rejected = 0;  // of the last 0.2 s
};

End vibrate(double amplitude, double tolerance) {
  Scenario s = load("cell");
  s.solver.tolerance = tolerance;
  s.solver.max_step = 5e-3;
  s.mechanism.exciter.amplitude = amplitude;
  Simulation sim(s);
  RestPose rest = sim.rest();
  rest.z -= 0.004;
  sim.setRestTarget(rest, 0.02);
  EXPECT_EQ(sim.advance(1.0), StopReason::kOk);
  const RunCounts before = sim.counts();
  EXPECT_EQ(sim.advance(1.2), StopReason::kOk);
  const RunCounts after = sim.counts();
  return {sim.state().q.head<3>(), after.evaluations - before.evaluations,
          after.steps - before.steps, after.rejected - before.rejected};
}

// Explicit steps take 50 775 and 110 928 evaluations for 2 N at these tolerances, 26 330 and 54 054
// for 5 N.
TEST(SlowSlip, StepsFollowTheMotionAndErrorsTheTolerance) {
  for (const double amplitude : {2.0, 5.0}) {
    const End truth = vibrate(amplitude, 1e-12);
    for (const double tolerance : {1e-9, 1e-10}) {
      const End end = vibrate(amplitude, tolerance);
      const double error = (end.place - truth.place).cwiseAbs().maxCoeff();
      EXPECT_LT(error, 5.0 * tolerance) << amplitude << " N";
      EXPECT_LT(end.evaluations, tolerance < 5e-10 ? 30000 : 20000) << amplitude << " N";
      // steps shorten as slip comes to rest: predicted; without prediction 0.42 at 5 N and 1e-9 m
      EXPECT_LT(static_cast<double>(end.rejected), 0.2 * static_cast<double>(end.steps));
      std::printf(
          "%g N, tolerance %.0e: error %.1e m, %lld evaluations, %lld steps, %lld refused\n",
          amplitude, tolerance, error, static_cast<long long>(end.evaluations),
          static_cast<long long>(end.steps), static_cast<long long>(end.rejected));
    }
  }
}

}  // namespace
}  // namespace assembly_cell
