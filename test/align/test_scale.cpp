// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {
namespace {

Scenario scenario(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/" + name + ".yaml",
                      overrides);
}

TEST(Scale, IsOneInTheDefaultCell) {
  const Scale scale = scaleOf(scenario("cell").mechanism);
  for (const double factor :
       {scale.length, scale.travel, scale.force, scale.sink, scale.give, scale.step, scale.time}) {
    EXPECT_NEAR(factor, 1.0, 1e-4);  // five digits of the default's values
  }
}

// Dimensions: all lengths twice, the density a quarter, the natural frequencies kept. Mass 2,
// stiffness 2 and 8, damping alike: a light touch of half as much more force moves three quarters
// as far as before.
TEST(Scale, FollowsTheMechanism) {
  Mechanism m = scenario("cell").mechanism;
  m.gravity = 0.75 * 9.8;  // so that the touch is 1.5 times as heavy, within its bounds
  m.peg.radius *= 2;
  m.peg.half_height *= 2;
  m.peg.coupling_height *= 2;
  m.peg.mass *= 2;
  m.peg.inertia_transverse *= 8;
  m.peg.inertia_axial *= 8;
  for (CouplingMatrix* matrix : {&m.coupling.stiffness, &m.coupling.damping}) {
    matrix->diagonal.head<3>() *= 2;
    matrix->diagonal.tail<3>() *= 8;
    matrix->k26 *= 4;
    matrix->k35 *= 4;
  }
  const Scale scale = scaleOf(m);
  EXPECT_NEAR(scale.length, 2.0, 1e-12);
  EXPECT_NEAR(scale.force, 1.5, 1e-12);
  EXPECT_NEAR(scale.sink, 0.75, 1e-4);
  EXPECT_NEAR(scale.give, 0.75, 1e-4);
  EXPECT_NEAR(scale.step, 0.75, 1e-3);  // impedance twice, force 1.5 times
  EXPECT_NEAR(scale.time, 1.0, 1e-12);  // the same decay
  m.coupling.damping.diagonal *= 0.1;
  m.coupling.damping.k26 *= 0.1;
  m.coupling.damping.k35 *= 0.1;
  EXPECT_GT(scaleOf(m).time, 5.0);
  m.coupling.stiffness.diagonal(0) = 0.0;
  EXPECT_THROW(scaleOf(m), InputError);
}

// A machine's move ends off by some micrometres, by which a stiff coupling pushes: no touch yet.
TEST(Scale, ATouchIsMoreThanALanding) {
  Mechanism m = scenario("cell").mechanism;
  m.coupling.stiffness.diagonal(0) *= 4;
  EXPECT_NEAR(scaleOf(m).force, 15e-6 * 2e5 / 1.5, 1e-12);
  m.peg.mass *= 3;
  EXPECT_NEAR(scaleOf(m).force, 4.0 / 1.5, 1e-12);
  m.coupling.stiffness.diagonal(0) *= 100;
  EXPECT_NEAR(scaleOf(m).force, 4.0 / 1.5, 1e-12);
}

// A heavy peg that hangs free pulls sideways when it is tilted: that is no contact.
TEST(Scale, WeightIsNoContact) {
  const Scenario s = startAt(scenario("cell", {"peg.mass=1.5"}), {0.06, 0.0}, {0.0, 0.0}, 0.02);
  SimulatedPlant plant(s, s.mechanism, CellParameters{});
  GuardedCarrier carrier(plant, pressLimits(s.mechanism));
  tareFreePeg(carrier, s.mechanism);
  RestPose tilted = carrier.target();
  tilted.phi += 0.1;
  carrier.moveTo(tilted);
  ASSERT_TRUE(carrier.settle());
  // 1.5 kg at 0.1 rad pull sideways by 1.47 N; what the deflection adds is second order
  EXPECT_LT(carrier.force().norm(), 0.05);
  EXPECT_LT(carrier.sensor().wrench().tail<3>().norm(), 0.005);
}

// Pegs that don't align with the constants of one peg.
TEST(Scale, AlignsOtherPegs) {
  const struct {
    const char* name;
    std::vector<std::string> overrides;
  } cells[] = {{"cell", {"peg.mass=1.0"}},
               {"pegs/r10_c10_steel_stiff", {}},
               {"pegs/r25_c100_aluminium_stiff", {}},
               {"pegs/r50_c200_aluminium", {}}};
  AlignParameters p;
  p.strategy = "touch";
  for (const auto& cell : cells) {
    const Scenario s = scenario(cell.name, cell.overrides);
    const AlignTrial trial = tryAlignment(s, s.mechanism, CellParameters{}, p);
    EXPECT_TRUE(trial.success) << cell.name << ": " << trial.result.reason;
  }
}

// A wall leads the low edge of a close fit aside: its place counts where nothing strains the
// coupling, and is then known to a few clearances at the first or second try.
TEST(Scale, FindsTheMiddleOfACloseFit) {
  const Scenario s =
      startAt(scenario("pegs/r5_c5_aluminium"), {0.0037, -0.00929}, {0.00928, -0.01603}, 0.003);
  AlignParameters p;
  p.strategy = "touch";
  const AlignTrial trial = tryAlignment(s, s.mechanism, CellParameters{}, p);
  EXPECT_TRUE(trial.success) << trial.result.reason;
  EXPECT_LT(trial.result.time, 40.0);
}

// A light touch sinks in by more than the depth at which the low edge is put into the hole, and on
// the face that depth makes less than 2 N.
TEST(Scale, DetectsTheFaceThroughASoftCoupling) {
  const Scenario s =
      startAt(scenario("pegs/r10_c40_aluminium_soft"), {0.006, 0.004}, {0.01, -0.01}, 0.003);
  AlignParameters p;
  p.strategy = "touch";
  const AlignTrial trial = tryAlignment(s, s.mechanism, CellParameters{}, p);
  EXPECT_TRUE(trial.success) << trial.result.reason;
}

}  // namespace
}  // namespace assembly_cell
