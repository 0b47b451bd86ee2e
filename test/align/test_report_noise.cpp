// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Carriers whose pose scatters.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "assembly_cell/align/search/free_peg.h"
#include "mismatched_trial.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;

RestPose poseAt(NormalSource& normal, double sd) {
  RestPose pose;
  pose.z = 0.08 + sd * normal();
  pose.theta += 0.1 * sd * normal();
  pose.phi += 0.1 * sd * normal();
  return pose;
}

// The measured deviation against that of the numbers: 400 pairs, overlapping, five standard errors.
TEST(ReportNoise, IsMeasured) {
  NormalSource normal(3);
  ReportNoiseMeter meter;
  for (int i = 0; i < 400; ++i) meter.add(poseAt(normal, 2e-5));
  EXPECT_NEAR(meter.noise().position, 2e-5, 5 * 2e-5 / std::sqrt(2 * 400.0 / 1.5));
  EXPECT_NEAR(meter.noise().rotation, 2e-6, 5 * 2e-6 / std::sqrt(4 * 400.0 / 1.5));
}

TEST(ReportNoise, IsNoneOfACarrierThatReportsExactly) {
  NormalSource normal(3);
  ReportNoiseMeter meter;
  EXPECT_EQ(meter.noise().position, 0.0);
  for (int i = 0; i < 100; ++i) meter.add(poseAt(normal, 1e-9));
  EXPECT_EQ(meter.noise().position, 0.0);
  EXPECT_EQ(blocksToEnd(meter.noise()), 0);
  // a move in between is no noise
  RestPose far;
  far.z = 1.0;
  meter.interrupt();
  meter.add(far);
  EXPECT_EQ(meter.noise().position, 0.0);
}

TEST(ReportNoise, ArrivalAllowsForIt) {
  RestPose target, at, before;
  at.z = before.z = target.z + 3e-5;
  EXPECT_FALSE(arrived(before, at, target, {}));
  EXPECT_TRUE(arrived(before, at, target, {1e-5, 1e-6}));
  // not where the noise doesn't reach, nor by a tilt that it leaves alone
  at.z = before.z = target.z + 9e-5;
  EXPECT_FALSE(arrived(before, at, target, {1e-5, 1e-6}));
  at = before = target;
  at.theta = before.theta = target.theta + 3e-5;
  EXPECT_FALSE(arrived(before, at, target, {1e-5, 1e-6}));
  EXPECT_EQ(blocksToEnd({1e-5, 1e-6}), 2);
}

AlignTrial noisyTrial(const std::string& mismatch, const std::string& strategy,
                      std::uint64_t seed) {
  const double a = 2.4 * static_cast<double>(seed);
  return tryMismatched(parseMismatch(mismatch, "test"), 0.006 * Vector2d(std::cos(a), std::sin(a)),
                       0.02 * Vector2d(std::sin(2 * a), std::cos(2 * a)), strategy, seed);
}

TEST(ReportNoise, StrategiesArriveInIt) {
  for (const char* strategy : {"twin_force", "single_contact"}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const AlignTrial trial = noisyTrial("carrier: {reading_noise: 1.0e-5}", strategy, seed);
      EXPECT_TRUE(trial.success) << strategy << " seed " << seed << ": " << trial.result.reason;
    }
  }
}

// A carrier that never reports exactly where it was sent: a peg under it is freed within two
// of the five seconds that a goal that failed has for it.
TEST(ReportNoise, APegIsFreedInIt) {
  Scenario scenario = loadScenario(ASSEMBLY_CELL_SOURCE_DIR "/config/scenarios/cell.yaml");
  CellParameters cell;
  cell.truth = drawTruth(parseMismatch("carrier: {reading_noise: 1.0e-5}", "test"), 1).cell;
  SimulatedPlant plant(scenario, scenario.mechanism, cell);
  GuardedCarrier hand(plant, pressLimits(scenario.mechanism));
  const double from = plant.truth().carrier().z, begin = hand.last().time;
  releasePeg(hand, scenario.mechanism);
  EXPECT_NEAR(plant.truth().carrier().z, from + 1e-3, 1e-4);
  EXPECT_LT(hand.last().time - begin, 2.0);
  // where it is known to hang free it stays, also when it has to be lifted for a proof: a peg that
  // weighs something else than drawn
  Mechanism lighter = scenario.mechanism;
  lighter.peg.mass = 0.2;
  const RestPose hung = hand.last().carrier;
  for (const Mechanism& mechanism : {scenario.mechanism, lighter}) {
    releasePeg(hand, mechanism, hung);
    EXPECT_NEAR(plant.truth().carrier().z, from + 1e-3, 1e-4);
  }
}

}  // namespace
}  // namespace assembly_cell
