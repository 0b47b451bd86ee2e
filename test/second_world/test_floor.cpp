// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Detection of the hole's floor in MuJoCo; test_insert has the exact simulator.
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/cell/world_choice.h"

using namespace assembly_cell;
using Eigen::Vector2d;

namespace {

constexpr double kFloor = 0.05;  // [m]

class InsertionFloor : public testing::Test {
 protected:
  InsertionFloor() {
    Scenario s =
        loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
    s.mechanism.hole.radius = s.mechanism.peg.radius + 1e-4;
    truth_ = startAt(s, Vector2d(-0.009, 0.005), Vector2d(0.02, 0.01), 0.003);
    truth_.mechanism.hole.depth = kFloor;
    sensors_.world = parseWorld("mujoco", "world");
    parameters_.strategy = "twin_force";
    parameters_.insert.floor = true;
  }
  AlignTrial trial(double drawn) const {
    Mechanism drawing = truth_.mechanism;
    drawing.hole.depth = drawn;
    return tryAlignment(truth_, drawing, sensors_, parameters_);
  }

  Scenario truth_;
  CellParameters sensors_;
  AlignParameters parameters_;
};

}  // namespace

// Seated where the truth has the floor, by evidence.
TEST_F(InsertionFloor, IsDetectedAndPressedGently) {
  const AlignTrial trial = this->trial(kFloor);
  const InsertResult& r = trial.result.insert;
  EXPECT_TRUE(trial.success) << trial.result.reason;
  EXPECT_TRUE(r.seated);
  EXPECT_EQ(r.backed_out, 0);
  EXPECT_NEAR(r.end.depth, kFloor, 5e-5);
  EXPECT_NEAR(trial.depth, kFloor, 5e-5);
  EXPECT_LT(r.force, parameters_.insert.force);
}

// A drawing with the floor higher up or farther down than it is: nothing is seated there.
TEST_F(InsertionFloor, IsRefusedWhereTheDrawingHasNone) {
  for (const double drawn : {0.03, 0.053}) {
    const AlignTrial trial = this->trial(drawn);
    EXPECT_FALSE(trial.success);
    EXPECT_FALSE(trial.false_success);
    EXPECT_EQ(trial.result.failure, AlignFailure::kNotSeated) << trial.result.reason;
    EXPECT_LT(trial.result.insert.force, parameters_.force_limit);
  }
}
