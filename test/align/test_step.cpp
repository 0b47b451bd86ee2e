// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Blocks put together to the steps of a strategy.
#include "assembly_cell/align/search/step.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "assembly_cell/align/estimation/contact_window.h"

namespace assembly_cell {
namespace {

constexpr double kPeriod = 2e-4;  // of samples [s]

// Blocks of so many samples of noise, with a load from some block on.
struct Blocks {
  int size = 10;
  int touch = 1 << 30;  // block from which on something pushes
  double force = 0.0;   // upwards [N]
  int given = 0, commanded = 0;
  std::vector<double> samples_a, samples_b;
  std::mt19937_64 random{1};

  PlantBlock next(const PlantCommand& command) {
    if (command.rest) ++commanded;
    std::normal_distribution<double> normal;
    std::vector<double> a, b;
    for (int i = 0; i < 6 * size; ++i) {
      a.push_back(normal(random));
      b.push_back(0.01 * normal(random) + (i % 6 == 2 && given >= touch ? force : 0.0));
    }
    samples_a.insert(samples_a.end(), a.begin(), a.end());
    samples_b.insert(samples_b.end(), b.begin(), b.end());
    const BlockMoments m_a = momentsOf(a.data(), a.size() / 6);
    const BlockMoments m_b = momentsOf(b.data(), b.size() / 6);
    PlantBlock block;
    block.wrench_a = m_a.mean;
    block.wrench_b = m_b.mean;
    block.covariance_a = m_a.covariance;
    block.covariance_b = m_b.covariance;
    block.samples = size;
    block.length = size * kPeriod;
    block.time = ++given * block.length;
    block.displacement_b = 1e-6 * m_b.mean;
    block.saturated = given == 3;
    return block;
  }
  PlantBlock step(const PlantCommand& command) {
    return nextStep(command,
                    [this](const PlantCommand& asked, bool /*first*/) { return next(asked); });
  }
};

PlantCommand watching(double force) {
  PlantCommand command;
  command.rest = RestPose{};
  command.alarm = ForceAlarm{};
  command.alarm->force = force;
  return command;
}

TEST(Step, HasTheMomentsOfAllItsSamples) {
  for (const int size : {5, 7, 10, 50}) {
    Blocks blocks;
    blocks.size = size;
    const PlantBlock step = blocks.step(watching(1.5));
    const BlockMoments a = momentsOf(blocks.samples_a.data(), blocks.samples_a.size() / 6);
    const BlockMoments b = momentsOf(blocks.samples_b.data(), blocks.samples_b.size() / 6);
    EXPECT_TRUE(step.wrench_a.isApprox(a.mean, 1e-12)) << size;
    EXPECT_TRUE(step.wrench_b.isApprox(b.mean, 1e-12)) << size;
    EXPECT_TRUE(step.covariance_a.isApprox(a.covariance, 1e-12)) << size;
    EXPECT_TRUE(step.covariance_b.isApprox(b.covariance, 1e-12)) << size;
    EXPECT_TRUE(step.displacement_b.isApprox(1e-6 * b.mean, 1e-12)) << size;
    EXPECT_EQ(step.samples, a.count);
    EXPECT_GE(step.length, kStepTime - 1e-9);
    EXPECT_LT(step.length, kStepTime + size * kPeriod);
    EXPECT_EQ(step.saturated, blocks.given >= 3);
    EXPECT_EQ(blocks.commanded, 1) << "what is commanded is so once";
  }
}

TEST(Step, ALongBlockIsGivenAsItIs) {
  Blocks blocks, same;
  blocks.size = same.size = 100;
  const PlantBlock step = blocks.step({}), block = same.next({});
  EXPECT_EQ(blocks.given, 1);
  EXPECT_TRUE(step.wrench_b == block.wrench_b);
  EXPECT_TRUE(step.covariance_a == block.covariance_a);
}

TEST(Step, EndsWithTheBlockOfTheAlarm) {
  Blocks blocks;
  blocks.touch = 13;
  blocks.force = 2.0;
  EXPECT_EQ(blocks.step(watching(1.5)).samples, 100);
  const PlantBlock alarmed = blocks.step(watching(1.5));
  EXPECT_EQ(blocks.given, 14);
  EXPECT_EQ(alarmed.samples, 10) << "alone: what was before it would hide it";
  EXPECT_NEAR(alarmed.wrench_b(2), 2.0, 0.05);
  // less than the alarm's force is included, too, at the step's end
  EXPECT_EQ(blocks.step(watching(2.5)).samples, 100);
}

TEST(Step, NoiseIsNoAlarm) {
  Blocks blocks;
  EXPECT_EQ(blocks.step(watching(1e-3)).samples, 100);
}

TEST(Step, KeepsAReadingThatCameOnTheWay) {
  Blocks blocks;
  const PlantBlock step = nextStep({}, [&](const PlantCommand& asked, bool /*first*/) {
    PlantBlock block = blocks.next(asked);
    if (blocks.given == 4) block.locus = LocusReading{};
    return block;
  });
  EXPECT_TRUE(step.locus);
  EXPECT_FALSE(step.vibration);
}

}  // namespace
}  // namespace assembly_cell
