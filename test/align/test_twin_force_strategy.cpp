// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"
#include "mismatched_trial.h"
#include "scenarios.h"

using namespace assembly_cell;
using Eigen::Vector2d;

namespace {

AlignParameters twinForceParameters() {
  AlignParameters p;
  p.strategy = "twin_force";
  return p;
}

// changes what a strategy sees or counts what it does
class WatchedPlant : public Plant {
 public:
  explicit WatchedPlant(Plant& plant) : plant_(plant) {}
  PlantBlock next(const PlantCommand& command) override {
    shaken = shaken || (command.exciter && command.exciter->amplitude > 0.0);
    if (command.rest) commands.push_back(command.rest->x);
    PlantBlock block = plant_.next(command);
    block.wrench_a *= sign;
    drift += drift_per_block;
    block.wrench_b(2) += drift;
    return block;
  }
  TwinForceSensing* twinForce() override { return plant_.twinForce(); }
  double sign = 1.0, drift_per_block = 0.0, drift = 0.0;
  bool shaken = false;
  std::vector<double> commands;

 private:
  Plant& plant_;
};

}  // namespace

// 15 mm and 2 degrees off; estimates against the truth of the peg as it hung
TEST(TwinForceStrategy, ReachesTheHole) {
  const Scenario s = cell();
  const struct {
    Vector2d offset, tilt;
  } starts[] = {{{0.0042, -0.0027}, {0.012, 0.013}},
                {{-0.0106, 0.0106}, {-0.03, 0.018}},
                {{0.002, 0.0}, {0.0, 0.0}}};
  for (const auto& start : starts) {
    SimulatedPlant plant(startAt(s, start.offset, start.tilt, 0.003), s.mechanism,
                         CellParameters{});
    WatchedPlant watched(plant);
    Vector2d true_offset(0, 0), true_tilt(0, 0);
    const AlignResult result =
        align(watched, s.mechanism, twinForceParameters(), [&](const AlignProgress& now) {
          if (now.state != "tare") return;
          true_offset = -plant.truth().pegPose().p.head<2>();
          true_tilt = tiltOf(plant.truth().pegPose());
        });
    EXPECT_TRUE(result.success) << result.reason;
    EXPECT_LE(edgeReach(plant.truth().pegPose(), s.mechanism.peg.radius), s.mechanism.hole.radius);
    EXPECT_FALSE(watched.shaken);
    EXPECT_GE(result.contacts, 3);
    EXPECT_LE(result.contacts, 12);
    // a fifth of the clearance of 0.1 mm, and 6 of its own sd
    EXPECT_LT((result.offset - true_offset).norm(), 2e-5);
    EXPECT_LT((result.offset - true_offset).norm(),
              6 * std::sqrt(result.offset_covariance.trace()));
    EXPECT_LT((result.tilt - true_tilt).norm(), std::max(3e-4, 6 * result.tilt_sd));
  }
}

TEST(TwinForceStrategy, RepeatsToTheLastBit) {
  const Scenario s = cell();
  std::vector<double> first;
  for (int i = 0; i < 2; ++i) {
    SimulatedPlant plant(s, s.mechanism, CellParameters{});
    WatchedPlant watched(plant);
    align(watched, s.mechanism, twinForceParameters());
    if (i == 0) first = watched.commands;
    EXPECT_GT(watched.commands.size(), 50u);
    EXPECT_EQ(watched.commands, first);
  }
}

TEST(TwinForceStrategy, FailsByName) {
  const Scenario s = cell();
  const auto reason = [&](double sign, double drift, double force) {
    CellParameters parameters;
    if (force < 15.0) parameters.bits = 10;
    SimulatedPlant plant(s, s.mechanism, parameters);
    WatchedPlant watched(plant);
    watched.sign = sign;
    watched.drift_per_block = drift;
    AlignParameters p = twinForceParameters();
    p.contact_force = force;
    const AlignResult result = align(watched, s.mechanism, p);
    EXPECT_FALSE(result.success);
    return result.reason;
  };
  // one sensor mounted the wrong way round
  EXPECT_EQ(reason(-1.0, 0.0, 15.0).rfind("sensor_signs", 0), 0u);
  // 0.5 N/s: within what counts as still from block to block, not over a window
  EXPECT_EQ(reason(1.0, 0.01, 15.0).rfind("not_settled", 0), 0u);
  // 10 bit can't tell from a light press where to feel, and the strategy knows
  EXPECT_EQ(reason(1.0, 0.0, 2.0).rfind("too_uncertain", 0), 0u);
}

// sensors off by 1 %, 1° and 0.5 mm, a carrier that repeats to 30 µm, and the rest of level 2
TEST(TwinForceStrategy, AlignsWhereSensorsAreOff) {
  const Mismatch level_2 =
      loadMismatch(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/mismatch/level_2.yaml");
  constexpr int kCells = 8;
  for (int i = 0; i < kCells; ++i) {
    const double a = 0.8 * i;
    const AlignTrial trial = tryMismatched(level_2, 0.01 * Vector2d(std::cos(a), std::sin(a)),
                                           0.02 * Vector2d(std::sin(2 * a), std::cos(3 * a)),
                                           "twin_force", 700 + static_cast<unsigned>(i));
    EXPECT_TRUE(trial.success) << i << " " << trial.result.reason;
    EXPECT_FALSE(trial.false_success);
    const Vector2d error = trial.result.offset - trial.true_offset;
    // 30 µm an axis: beyond 5 sd never by chance
    EXPECT_LT(error.norm(), 1.5e-4) << i;
    // what moves end by is stated, as far as six touches tell it
    const double sd = std::sqrt(0.5 * trial.result.offset_covariance.trace());
    EXPECT_GT(sd, 9e-6) << i;
    EXPECT_LT(sd, 1.5e-4) << i;
  }
}

// Sensors of level 2, calibrated before they were built in: the centre's error from their wrenches
// is as large as the stated one. With the deviations of uncalibrated matrices it would be half of
// that.
TEST(TwinForceStrategy, UsesTheCovariancesOfCalibrations) {
  const Mismatch level_2 =
      loadMismatch(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/mismatch/level_2.yaml");
  constexpr int kCells = 50;
  double squared = 0.0;
  for (int i = 0; i < kCells; ++i) {
    const double a = 0.8 * i;
    const AlignTrial trial = tryMismatched(level_2, 0.01 * Vector2d(std::cos(a), std::sin(a)),
                                           0.02 * Vector2d(std::sin(2 * a), std::cos(3 * a)),
                                           "twin_force", 7400 + static_cast<unsigned>(i), 3);
    EXPECT_TRUE(trial.success) << i << " " << trial.result.reason;
    ASSERT_TRUE(trial.result.wrench_offset);
    const Vector2d error = *trial.result.wrench_offset - trial.true_offset;
    squared += error.dot(trial.result.wrench_covariance.inverse() * error);
  }
  // 2 where it is right, within two standard errors
  EXPECT_NEAR(squared / kCells, 2.0, 2.0 * 2.0 / std::sqrt(kCells));
}

// The tip, a fifth of the radius, hangs in a mouth nearly twice as wide as the hole wherever a
// sharp edge would reach over the rim: the carrier was sent 2e7 km away.
TEST(TwinForceStrategy, AdvisesReachableContacts) {
  Scenario s = cell();
  s.mechanism.peg.chamfer_width = s.mechanism.hole.chamfer_width = 0.02;
  const Scenario start = startAt(s, {0.046, 0.003}, {0.012, -0.013}, 0.003);
  SimulatedPlant plant(start, s.mechanism, CellParameters{});
  const AlignResult result = align(plant, s.mechanism, twinForceParameters());
  EXPECT_TRUE(result.success) << result.reason;
  EXPECT_GE(result.contacts, 3);
}

TEST(TwinForceStrategy, RefusesBadParameters) {
  const Scenario s = cell();
  const auto message = [&](const std::function<void(AlignParameters&)>& change) {
    AlignParameters p = twinForceParameters();
    change(p);
    try {
      checkParameters(p);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message([](AlignParameters&) {}), "");
  const std::string unknown = message([](AlignParameters& p) { p.strategy = "twin"; });
  EXPECT_NE(unknown.find("strategy: value twin: give one of"), std::string::npos) << unknown;
  EXPECT_NE(unknown.find("single_contact, double_contact, twin_force"), std::string::npos)
      << unknown;
  EXPECT_NE(
      message([](AlignParameters& p) { p.contact_force = 41.0; }).find("contact_force: value 41"),
      std::string::npos);
  EXPECT_NE(message([](AlignParameters& p) { p.fewest_contacts = 1; }).find("fewest_contacts"),
            std::string::npos);
  EXPECT_NE(message([](AlignParameters& p) { p.most_contacts = 2; }).find("most_contacts"),
            std::string::npos);
  EXPECT_NE(message([](AlignParameters& p) {
              p.required_position = std::nan("");
            }).find("required_position"),
            std::string::npos);
  EXPECT_NE(message([](AlignParameters& p) { p.contact_window = 0.0; }).find("contact_window"),
            std::string::npos);
}
