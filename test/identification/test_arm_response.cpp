// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Delay and stiffness of an arm by a chirp in light contact, and the check of a goal.
#include "assembly_cell/identification/arm_response.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/align/search/carrier_delay.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/identification_trial.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

constexpr double kLatencies[] = {0.0, 0.05, 0.1, 0.25};
constexpr double kStep = 0.02;

// Blocks of an arm that answers after a delay, with a lag of first order, exactly: the chirp of an
// earlier time, its sines smaller and later. Noise of the force [N].
std::vector<ArmSample> blocksOf(double delay, double lag, double stiffness, double noise,
                                unsigned seed) {
  const ArmPlan plan;
  const double reach = 1.5 / stiffness, fine = 1e-4;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<ArmSample> samples;
  double reached = 0.0;
  int done = 0;
  for (int i = 0; i * kStep < plan.periods * plan.period; ++i) {
    const double time = i * kStep;
    for (; done * fine < time; ++done) {
      const double wanted = chirpAt(done * fine + 0.5 * fine - delay, plan.period);
      reached += lag > 0.0 ? fine / lag * (wanted - reached) : wanted - reached;
    }
    const double exact = lag > 0.0 ? reached : chirpAt(time - delay, plan.period);
    samples.push_back({time, reach * chirpAt(time, plan.period),
                       4.0 + stiffness * reach * exact + normal(random)});
  }
  return samples;
}

TEST(ArmResponse, TheFitFindsDelayAndStiffnessWithinThreeStandardDeviations) {
  int inside = 0, count = 0;
  for (const double latency : kLatencies) {
    for (const double lag : {0.0, 0.03}) {
      for (const double stiffness : {3e4, 2e5}) {
        for (unsigned seed = 1; seed <= 10; ++seed) {
          const ArmResponse found =
              fitArm(blocksOf(latency + kStep, lag, stiffness, 0.02, seed), 0.0, ArmPlan()).arm;
          const double delay = latency + kStep + lag;
          EXPECT_NEAR(found.delay, delay, 0.004);
          EXPECT_NEAR(found.stiffness / stiffness, 1.0, 0.02);
          inside += std::abs(found.delay - delay) < 3.0 * found.delay_sd ? 1 : 0;
          inside += std::abs(found.stiffness - stiffness) < 3.0 * found.stiffness_sd ? 1 : 0;
          count += 2;
        }
      }
    }
  }
  EXPECT_GE(inside, 0.98 * count) << "of " << count;
}

TEST(ArmResponse, AForceThatDoesNotFollowIsNoResponse) {
  std::vector<ArmSample> samples = blocksOf(kStep, 0.0, 3e4, 0.02, 1);
  // within a gap as wide as the chirp nothing moves
  double held = 0.0;
  for (ArmSample& sample : samples) {
    held = std::max(std::min(held, sample.command + 3e-5), sample.command - 3e-5);
    sample.force = 4.0 + 3e4 * held;
  }
  try {
    const ArmResponse found = fitArm(samples, 0.0, ArmPlan()).arm;
    // or its deviations say so
    EXPECT_GT(found.stiffness_sd, 0.02 * found.stiffness);
  } catch (const AlignError& error) {
    EXPECT_EQ(error.failure, AlignFailure::kNoReading) << error.what();
  }
}

std::shared_ptr<ArmSetup> armWith(double latency) {
  auto setup = std::make_shared<ArmSetup>(
      loadArmSetup(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/arm/emulated.yaml"));
  setup->arm.arm.latency = latency;
  setup->bridge.limits.following_time = latency + 0.15;
  return setup;
}

CellParameters lateCell(bool arm, double latency, std::uint64_t seed) {
  CellParameters cell;
  cell.seed = seed;
  if (arm) {
    cell.arm = armWith(latency);
  } else {
    cell.truth.carrier.latency = latency;
  }
  return cell;
}

Scenario withMount(double factor) {
  Scenario scenario = cell();
  CouplingMatrix& k = scenario.mechanism.coupling.stiffness;
  k.diagonal *= factor;
  k.k26 *= factor;
  k.k35 *= factor;
  return scenario;
}

TEST(ArmResponse, MeasuredInTheCellAndThroughAnArm) {
  for (const bool arm : {false, true}) {
    for (const double latency : kLatencies) {
      for (const double mount : {1.0, 2.0}) {
        const Scenario scenario = withMount(mount);
        const ArmTrial trial = tryArmIdentification(scenario, scenario.mechanism,
                                                    lateCell(arm, latency, 5), ArmPlan());
        const std::string what = "arm " + std::to_string(arm) + ", latency " +
                                 std::to_string(latency) + ", mount " + std::to_string(mount);
        ASSERT_EQ(trial.refusal, "") << what;
        const ArmResponse &found = trial.found.arm, &truth = trial.truth;
        EXPECT_NEAR(found.delay, truth.delay, 3.0 * found.delay_sd) << what;
        EXPECT_NEAR(found.stiffness, truth.stiffness, 3.0 * found.stiffness_sd) << what;
        EXPECT_LT(found.delay_sd, 0.003) << what;
        EXPECT_LT(found.stiffness_sd, 0.02 * found.stiffness) << what;
        // the mount is the spring, and the emulated arm yields by 0.5 um/N besides
        const double yields = pressCompliance(scenario.mechanism) + (arm ? 5e-7 : 0.0);
        EXPECT_NEAR(found.stiffness * yields, 1.0, 0.03) << what;
        EXPECT_LT(trial.found.force, 10.0) << what;
      }
    }
  }
}

TEST(ArmResponse, TooStiffAMountIsRefusedAndTooLateAnArmNamed) {
  const Mechanism stiff = withMount(60.0).mechanism;
  try {
    checkArmPlan(stiff, ArmPlan());
    ADD_FAILURE() << "accepted";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("coupling.stiffness: the mount yields 0.5", 0), 0U)
        << error.what();
  }
  EXPECT_NO_THROW(checkArmPlan(withMount(20.0).mechanism, ArmPlan()));
  CellParameters late = lateCell(false, 0.25, 5);
  late.truth.carrier.lag = 0.25;
  const Scenario scenario = cell();
  const ArmTrial trial = tryArmIdentification(scenario, scenario.mechanism, late, ArmPlan());
  EXPECT_NE(trial.refusal, "");
}

TEST(ArmResponse, AGoalComparesTheDelayOnFile) {
  const auto run = [](double on_file, double sd, double latency) {
    Scenario scenario = cell();
    scenario.mechanism.arm.delay = on_file;
    scenario.mechanism.arm.delay_sd = sd;
    AlignParameters parameters;
    parameters.strategy = "touch";
    return tryAlignment(scenario, scenario.mechanism, lateCell(false, latency, 3), parameters);
  };
  EXPECT_TRUE(run(0.023, 0.001, 0.0).success);
  EXPECT_TRUE(run(0.123, 0.001, 0.1).success);
  const AlignTrial later = run(0.05, 0.001, 0.12);
  EXPECT_EQ(later.status, "wrong_mechanism");
  double seen = 0.0;
  EXPECT_EQ(std::sscanf(later.result.reason.c_str(), "wrong_mechanism: the arm answers after %lf s",
                        &seen),
            1)
      << later.result.reason;
  // a peg that hasn't moved yet is looked at once a block of 20 ms
  EXPECT_NEAR(seen, 0.142, 0.012) << later.result.reason;
  EXPECT_NE(later.result.reason.find(", on file are 0.050 s (arm.delay): measure it again"),
            std::string::npos)
      << later.result.reason;
  EXPECT_EQ(run(0.142, 0.001, 0.0).status, "wrong_mechanism");
  // nothing on file to compare with
  EXPECT_TRUE(run(0.142, 0.0, 0.0).success);
}

TEST(DelayMeter, FindsTheDelayOfADescentAndThatOfACarrierAtRest) {
  for (const double delay : kLatencies) {
    DelayMeter meter;
    const auto height = [](double time) { return 0.1 - 2e-3 * std::max(0.0, time); };
    meter.begin(height(0.0), 0.0);
    for (int i = 0; i < 30; ++i) {
      const double time = kStep * (i + 1);
      EXPECT_FALSE(meter.settled().has_value() && time < delay) << time;
      meter.command(height(time), time);
      // a step's end is when the height is known
      meter.report(height(time + kStep - delay), time + kStep, 0.0);
    }
    ASSERT_TRUE(meter.settled().has_value());
    // a delay of less than a step isn't seen
    EXPECT_NEAR(*meter.settled(), std::max(delay, kStep), 0.001);
  }
  DelayMeter still;
  still.begin(0.1, 0.0);
  for (int i = 0; i < 30; ++i) {
    still.command(0.1 - 1e-4 * (i + 1), kStep * i);
    still.report(0.1, kStep * (i + 1), 1e-6);
  }
  EXPECT_FALSE(still.settled().has_value());
  EXPECT_NEAR(still.still(), 0.6, 1e-9);
}

}  // namespace
}  // namespace assembly_cell
