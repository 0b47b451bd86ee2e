// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The insertion, against the ground truth of the exact simulation.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"

using namespace assembly_cell;
using Eigen::Vector2d;

namespace {

constexpr double kDepth = 0.04;  // [m]

struct Bore {
  const char* name;
  double clearance;  // radial [m]
  Vector2d lean;     // of the axis against the face, unknown to the strategy
  double friction;
  double force;  // largest contact force allowed [N]
};

class Insertion : public testing::TestWithParam<Bore> {};

Scenario fit(double clearance) {
  Scenario s = loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  s.mechanism.hole.radius = s.mechanism.peg.radius + clearance;
  return s;
}

AlignParameters parameters() {
  AlignParameters p;
  p.strategy = "twin_force";
  p.insert.depth = kDepth;
  return p;
}

// Force: at rest in two-point contact a bore that leans by more than the peg can bends the coupling
// by the difference, (lean - 2 clearance / depth) 50 N m/rad over a lever of up to the depth.
const Bore kBores[] = {{"wide", 1e-4, {0.0, 0.0}, 0.2, 2.0},
                       {"tight", 2e-5, {0.0, 0.0}, 0.2, 2.0},
                       {"leaning", 1e-4, {0.0025, -0.0025}, 0.2, 5.0},
                       {"leaning_tight", 2e-5, {-0.0025, 0.0025}, 0.4, 12.0}};

}  // namespace

TEST_P(Insertion, EndsSeated) {
  const Bore& bore = GetParam();
  Scenario truth =
      startAt(fit(bore.clearance), Vector2d(-0.009, 0.005), Vector2d(0.02, 0.01), 0.003);
  const Mechanism nominal = truth.mechanism;
  truth.imperfections.bore_lean = bore.lean;
  truth.mechanism.friction = {bore.friction, bore.friction};
  CellParameters sensors;
  sensors.seed = 17;
  const AlignTrial trial = tryAlignment(truth, nominal, sensors, parameters());
  const InsertResult& r = trial.result.insert;
  EXPECT_TRUE(trial.success) << trial.result.reason;
  EXPECT_TRUE(r.seated);
  EXPECT_EQ(r.backed_out, 0);
  // the height of the plane is known to some micrometres, a block on the path down is 0.2 mm, and
  // it stops in the next one: of 100 seeds 0.325 mm at most, in the tight bore that leans
  EXPECT_NEAR(r.end.depth, trial.depth, 5e-5);
  EXPECT_GE(trial.depth, kDepth - 5e-5);
  EXPECT_LE(trial.depth, kDepth + 3.5e-4);
  EXPECT_LT(r.force, bore.force);
  ASSERT_EQ(r.profile.size(), 41u);
  for (std::size_t i = 1; i < r.profile.size(); ++i) {
    EXPECT_NEAR(r.profile[i].depth, 1e-3 * static_cast<double>(i), 2.5e-4);
  }
  // the walls have led the peg: its tilt against the bore is within the clearance of both
  const Vector2d lean(trial.X_HP.R(0, 2), trial.X_HP.R(1, 2));
  EXPECT_LT((lean - bore.lean).norm(), 2.0 * bore.clearance / kDepth + 5e-4);
}

INSTANTIATE_TEST_SUITE_P(One, Insertion, testing::ValuesIn(kBores),
                         [](const auto& test) { return std::string(test.param.name); });

// The exciter shakes from the bore's mouth to the depth, and no longer.
TEST(InsertionExciter, ShakesDuringTheInsertionOnly) {
  const Scenario s = startAt(fit(2e-5), Vector2d(-0.009, 0.005), Vector2d(0.02, 0.01), 0.003);
  AlignParameters p = parameters();
  p.insert.exciter = 2.0;
  const AlignTrial trial = tryAlignment(s, s.mechanism, CellParameters{}, p);
  EXPECT_TRUE(trial.success) << trial.result.reason;
  const AlignTrial still = tryAlignment(s, s.mechanism, CellParameters{}, parameters());
  EXPECT_TRUE(still.success) << still.result.reason;
  // 2 N at the wall are measured on the path, less in a mean over a block
  EXPECT_GT(trial.result.insert.force, still.result.insert.force + 0.1);
  EXPECT_LT(trial.result.insert.end.force(), still.result.insert.force + 0.1);
}

// A peg that was left in the hole at an unknown depth: out, and from the face.
TEST(InsertionDepth, CountsFromTheFaceWhereThePegIsInTheHoleAlready) {
  const Scenario s = fit(1e-4);
  for (const double before : {0.0037, 0.0147}) {
    AlignParameters p;
    p.insert.depth = 0.012;
    const Scenario start = startAt(s, Vector2d(4e-5, -3e-5), Vector2d(0.001, 0.0), -before);
    const AlignTrial trial = tryAlignment(start, s.mechanism, CellParameters{}, p);
    EXPECT_TRUE(trial.success) << trial.result.reason;
    EXPECT_NEAR(trial.depth, 0.012, 3.5e-4) << before;
    EXPECT_NEAR(trial.result.insert.end.depth, trial.depth, 5e-5);
  }
}

TEST(AlignProgress, ReportsThePegOutsideWhereItIs) {
  const Scenario s = fit(1e-4);
  for (const double z : {-0.0147, 0.004}) {
    const Scenario start = startAt(s, Vector2d(4e-5, -3e-5), Vector2d(0.001, 0.0), z);
    SimulatedPlant plant(start, s.mechanism, CellParameters{});
    bool outside = false;
    align(plant, s.mechanism, AlignParameters{}, [&](const AlignProgress& now) {
      outside = outside || now.state == AlignProgress::kOutside;
    });
    EXPECT_EQ(outside, z > 0.0) << z;
  }
}

// An alignment of it gives no depth, since the face isn't touched.
TEST(InsertionDepth, IsNotKnownOfAPegThatIsInTheHoleAlready) {
  const Scenario s = fit(1e-4);
  const Scenario start = startAt(s, Vector2d(4e-5, -3e-5), Vector2d(0.001, 0.0), -0.0147);
  const AlignTrial trial = tryAlignment(start, s.mechanism, CellParameters{}, AlignParameters{});
  EXPECT_TRUE(trial.success) << trial.result.reason;
  EXPECT_EQ(trial.result.depth, 0.0);
}

TEST(Withdrawal, MovesAPegOutOfTheHoleWhoseDepthIsNotKnown) {
  const Scenario s = fit(1e-4);
  for (const double depth : {0.001, 0.0147, 0.04}) {
    SimulatedPlant plant(startAt(s, Vector2d(4e-5, -3e-5), Vector2d(0.003, -0.002), -depth),
                         s.mechanism, CellParameters{});
    EXPECT_TRUE(withdraw(plant, s.mechanism, AlignParameters{})) << depth;
    EXPECT_GT(plant.truth().pegPose().p.z(), 0.003) << depth;
  }
  SimulatedPlant plant(startAt(s, Vector2d(4e-5, -3e-5), Vector2d(0.003, -0.002), 0.002),
                       s.mechanism, CellParameters{});
  const double before = plant.truth().pegPose().p.z();
  EXPECT_FALSE(withdraw(plant, s.mechanism, AlignParameters{}));
  EXPECT_NEAR(plant.truth().pegPose().p.z(), before, 1e-4);
}

TEST(InsertionDepth, OfAHoleTooShallowForAnAlignmentIsRefused) {
  Scenario s = fit(1e-4);
  s.mechanism.hole.depth = 4e-4;
  try {
    checkGoal(s.mechanism, AlignParameters{});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("hole.depth: 0.0004: ", 0), 0u) << error.what();
  }
  s.mechanism.hole.depth = 6e-4;
  EXPECT_NO_THROW(checkGoal(s.mechanism, AlignParameters{}));
}

// The bore ends before the requested depth: named, and the peg is free afterwards.
TEST(InsertionDepth, BelowTheFloorEndsByName) {
  for (const double floor : {0.004, 0.012, 0.03}) {
    Scenario s = startAt(fit(1e-4), Vector2d(-0.009, 0.005), Vector2d(0.02, 0.01), 0.003);
    const Mechanism nominal = s.mechanism;
    s.mechanism.hole.depth = floor;
    for (const bool to_floor : {false, true}) {
      AlignParameters p = parameters();
      p.insert.floor = to_floor;
      p.insert.depth = to_floor ? 0.0 : 0.04;
      const AlignTrial trial = tryAlignment(s, nominal, CellParameters{}, p);
      EXPECT_EQ(trial.result.reason.rfind(text("not_seated: floor at %.1f", floor * 1e3), 0), 0u)
          << trial.result.reason;
      EXPECT_LT(trial.result.insert.time, 15.0);
      // the force that stops the peg, and as much again in one step
      EXPECT_LT(trial.force, 2.0 * p.insert.force);
      EXPECT_LT(trial.depth, 0.0);
    }
  }
}

TEST(InsertionDepth, ThatReachesTheFloorIsRefused) {
  AlignParameters p = parameters();
  p.insert.depth = 0.06;
  const Scenario s = fit(1e-4);
  try {
    tryAlignment(s, s.mechanism, CellParameters{}, p);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "insert.depth: 0.06 m is not less than hole.depth, 0.06 m; give less");
  }
}

// A peg of 60 mm in a hole of 80 mm: to 59 mm, not to the floor.
TEST(InsertionDepth, WhereThePegsTopWouldGoInIsRefused) {
  Scenario s = fit(1e-4);
  s.mechanism.hole.depth = 0.08;
  for (const bool floor : {false, true}) {
    AlignParameters p = parameters();
    p.insert.depth = floor ? 0.0 : 0.0595;
    p.insert.floor = floor;
    try {
      checkGoal(s.mechanism, p);
      FAIL() << floor;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("at most 0.059 m"), std::string::npos)
          << error.what();
    }
  }
  AlignParameters p = parameters();
  p.insert.depth = 0.059;
  EXPECT_NO_THROW(checkGoal(s.mechanism, p));
}

TEST(InsertionFloor, NeedsADepthInTheDrawing) {
  AlignParameters p = parameters();
  p.insert.depth = 0.0;
  p.insert.floor = true;
  Scenario s = fit(1e-4);
  s.mechanism.hole.depth = std::numeric_limits<double>::infinity();
  EXPECT_THROW(tryAlignment(s, s.mechanism, CellParameters{}, p), InputError);
}

// To the floor in the exact simulation: touched, lifted off and touched again. In the default cell
// the peg is as long as the hole is deep; in the shallower one its side goes on over the face.
TEST(InsertionFloor, EndsSeatedInTheExactSimulation) {
  AlignParameters p;
  p.insert.floor = true;
  for (const double depth : {0.06, 0.05}) {
    for (const unsigned seed : {1u, 2u}) {
      Scenario s = fit(1e-4);
      s.mechanism.hole.depth = depth;
      const double round = 2.0 * seed;
      s = startAt(s, 0.01 * Vector2d(std::cos(round), std::sin(round)), Vector2d(0.02, -0.01),
                  0.003);
      CellParameters sensors;
      sensors.seed = seed;
      const AlignTrial trial = tryAlignment(s, s.mechanism, sensors, p);
      const InsertResult& r = trial.result.insert;
      EXPECT_TRUE(trial.success) << depth << " " << seed << " " << trial.result.reason;
      EXPECT_TRUE(r.seated);
      EXPECT_EQ(r.backed_out, 0);
      EXPECT_NEAR(trial.depth, depth, 2e-5);
      EXPECT_LT(r.force, 12.0);
      EXPECT_LT(std::abs(r.end.along), 2.0);
    }
  }
}
