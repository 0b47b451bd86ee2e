// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Means of blocks without samples, against the samples themselves.
#include "assembly_cell/cell/block_means.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "assembly_cell/cell/simulated_cell.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

// The sum over samples is exact for cubics but for the slope's change over the block: by
// Euler and Maclaurin (f'(n) − f'(0)) / 12 with a period of 1, here taken off.
TEST(SampleSum, IsExactForCubics) {
  for (const int n : {8, 9, 10, 20, 50, 97, 100}) {
    for (const int most : {1, 2, 5, 10, 25}) {
      const SampleSum sum(n, most);
      EXPECT_LE(sum.spacing(), most);
      EXPECT_EQ(sum.nodes() * sum.spacing(), n);
      for (int power = 0; power < 4; ++power) {
        const auto f = [&](double i) { return std::pow(i / n, power); };
        double exact = 0.0, found = 0.0, weights = 0.0;
        for (int i = 1; i <= n; ++i) exact += f(i);
        for (int node = 0; node <= sum.nodes(); ++node) {
          EXPECT_GE(sum.weight(node), 0.0);
          weights += sum.weight(node);
          found += sum.weight(node) * f(node * sum.spacing());
        }
        EXPECT_NEAR(weights, n, 1e-12 * n);
        EXPECT_NEAR(found, exact, 1e-11 * n) << n << ", " << most << ", power " << power;
      }
    }
  }
  EXPECT_EQ(SampleSum(100, 5).spacing(), 5);
  EXPECT_EQ(SampleSum(10, 5).spacing(), 5);
  EXPECT_EQ(SampleSum(97, 5).spacing(), 1);
}

// Moments of the chi-squared distribution: m and 2 m; of the estimates, five sd.
TEST(NormalSource, SumsOfSquaresHaveTheirMoments) {
  NormalSource normal(5);
  constexpr int n = 20000;
  for (const int m : {1, 2, 94, 99}) {
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < n; ++i) {
      const double x = normal.sumOfSquares(m) - m;
      sum += x;
      squares += x * x;
    }
    const double variance = 2.0 * m;
    EXPECT_NEAR(sum / n, 0.0, 5 * std::sqrt(variance / n)) << m;
    // fourth central moment 12 m (m + 4)
    EXPECT_NEAR(squares / n, variance, 5 * std::sqrt((12.0 * m * (m + 4) - 4.0 * m * m) / n)) << m;
  }
}

struct Pair {
  StrainMeans all, few;  // of all samples, and without
};

// Both cells are commanded alike: down to a press, shaken there. `see` is shown each block.
void press(const CellParameters& p, double amplitude, bool samples_b, int blocks,
           const std::function<void(const Pair&, double force)>& see) {
  const Scenario scenario = load("cell");
  SimulatedCell one(scenario, p), other(scenario, p);
  Pair pair;
  StrainBlock block;
  RestPose down = restFromPose(one.reported());
  down.z -= 0.0035;
  const ExciterParameters exciter{amplitude, 770.0, 0.0, 1};
  for (int k = 0; k < blocks; ++k) {
    for (SimulatedCell* cell : {&one, &other}) {
      if (k == 5) cell->command(poseFromRest(down));
      if (k == 40) cell->world().setExciter(exciter, cell->world().time());
    }
    ASSERT_EQ(one.next(block), StopReason::kOk);
    meansOf(block, pair.all);
    ASSERT_EQ(other.average(pair.few, k >= 40 ? exciter.frequency : 0.0, samples_b),
              StopReason::kOk);
    EXPECT_NEAR(pair.all.end, pair.few.end, 1e-14 * (k + 1));
    // the world is the same to rounding, whatever is looked at: steps end beside times that are
    EXPECT_LT((one.world().pegPose().p - other.world().pegPose().p).norm(), 1e-12) << k;
    see(pair, one.world().holeWrench().head<3>().norm());
  }
}

// With hardly any noise: 1 uV. At rest, hanging or pressed, the mean is that of the samples within
// the noise of a mean, 0.1 uV. Shaken by 2 N sensor_b, behind the coupling, is off by 1.5 mN
// through 0.04 V/N; in the hole friction jumps between slip and stick: 0.4 N.
TEST(BlockMeans, AreThoseOfTheSamples) {
  CellParameters p;
  p.bits = 24;
  p.noise = 1e-6;
  int k = 0;
  double still = 0.0, moving = 0.0, shaken_a = 0.0, shaken_b = 0.0;
  press(p, 2.0, false, 80, [&](const Pair& pair, double force) {
    const double a = (pair.all.a.mean - pair.few.a.mean).cwiseAbs().maxCoeff();
    const double b = (pair.all.b.mean - pair.few.b.mean).cwiseAbs().maxCoeff();
    if (k >= 40) {
      shaken_a = std::max(shaken_a, a);
      shaken_b = std::max(shaken_b, b);
    } else {
      double& worst = k < 5 || k > 30 ? still : moving;
      worst = std::max({worst, a, b});
    }
    if (k >= 40) {
      EXPECT_GT(force, 0.0);
      // what the vibration scatters, by a hundredth of itself
      const Matrix6 difference = pair.all.b.covariance - pair.few.b.covariance;
      EXPECT_LT(difference.norm(), 0.02 * pair.all.b.covariance.norm()) << k;
    }
    EXPECT_EQ(pair.few.volts_b.size(), 6u);
    ++k;
  });
  std::printf("off by %.2g V at rest, %.2g V on the way and touching, %.2g and %.2g V shaken\n",
              still, moving, shaken_a, shaken_b);
  EXPECT_LT(still, 1e-6);
  EXPECT_LT(moving, 0.01);
  EXPECT_LT(shaken_a, 0.03);
  EXPECT_LT(shaken_b, 1e-4);
}

// With the cell's noise: the difference of both means is that of two means of noise, their
// covariances are alike, and neither is too even.
TEST(BlockMeans, HaveTheNoiseOfTheSamples) {
  CellParameters p;
  const double noise = std::sqrt(p.noise * p.noise + std::pow(10.0 / 65536, 2) / 12);
  const int n = p.block_size;
  double means = 0.0;
  Matrix6 all = Matrix6::Zero(), few = all;
  double all_trace = 0.0, few_trace = 0.0;
  int blocks = 0;
  const Scenario scenario = load("cell");
  SimulatedCell one(scenario, p), other(scenario, p);
  StrainBlock block;
  Pair pair;
  for (; blocks < 1000; ++blocks) {
    ASSERT_EQ(one.next(block), StopReason::kOk);
    meansOf(block, pair.all);
    ASSERT_EQ(other.average(pair.few, 0.0, false), StopReason::kOk);
    EXPECT_EQ(pair.few.a.count, n);
    means += (pair.all.a.mean - pair.few.a.mean).squaredNorm() +
             (pair.all.b.mean - pair.few.b.mean).squaredNorm();
    all += pair.all.a.covariance;
    few += pair.few.a.covariance;
    all_trace += std::pow(pair.all.a.covariance.trace() - 6 * noise * noise, 2);
    few_trace += std::pow(pair.few.a.covariance.trace() - 6 * noise * noise, 2);
  }
  // twelve numbers a block, five sd of a mean square; seeds are alike, streams are not
  const double square = noise * noise;
  EXPECT_NEAR(means / (12.0 * blocks), 2 * square / n,
              5 * 2 * square / n / std::sqrt(6.0 * blocks));
  // an entry of a covariance has a variance of at most 2 noise⁴ / (n − 1)
  const double sd = square * std::sqrt(2.0 / (n - 1) / blocks);
  const Matrix6 exact = square * Matrix6::Identity();
  EXPECT_LT((all / blocks - exact).cwiseAbs().maxCoeff(), 5 * sd);
  EXPECT_LT((few / blocks - exact).cwiseAbs().maxCoeff(), 5 * sd);
  // and the traces scatter by 12 noise⁴ / (n − 1)
  const double scatter = 12 * square * square / (n - 1);
  EXPECT_NEAR(all_trace / blocks, scatter, 5 * scatter * std::sqrt(2.0 / blocks));
  EXPECT_NEAR(few_trace / blocks, scatter, 5 * scatter * std::sqrt(2.0 / blocks));
}

// Where sensor_b's samples are asked for they are those of whole blocks, to the last bit.
TEST(BlockMeans, SamplesThatAreAskedForAreMade) {
  press(CellParameters{}, 2.0, true, 60, [](const Pair& pair, double) {
    EXPECT_EQ(pair.all.volts_b, pair.few.volts_b);
    EXPECT_EQ(pair.all.b.mean, pair.few.b.mean);
  });
}

// Samples that depend on each other, and those that show the converter's codes, are all made.
TEST(BlockMeans, AllSamplesWhereTheyMatter) {
  CellParameters ten_bits, silent, late, walks, short_blocks;
  ten_bits.bits = 10;
  silent.noise = 0.0;
  late.truth.sensor_b.latency = 1.5e-3;
  walks.truth.sensor_a.walk = 0.1;
  short_blocks.block_size = 7;
  for (const CellParameters& p : {ten_bits, silent, late, walks, short_blocks}) {
    press(p, 2.0, false, 50, [](const Pair& pair, double) {
      EXPECT_EQ(pair.all.volts_b, pair.few.volts_b);
      EXPECT_EQ(pair.all.a.mean, pair.few.a.mean);
      EXPECT_EQ(pair.all.a.covariance, pair.few.a.covariance);
    });
  }
}

// Hum of 400 Hz would be seen as 200 Hz once a millisecond: its share of the mean is there all the
// same. 1 N has 0.04 V.
TEST(BlockMeans, HumIsFollowed) {
  CellParameters p;
  p.bits = 24;
  p.noise = 1e-6;
  p.truth.sensor_b.hum << 1.0, 0.0, 0.0;
  p.truth.sensor_b.hum_frequency = 404.0;
  press(p, 0.0, false, 5, [](const Pair& pair, double) {
    EXPECT_LT((pair.all.b.mean - pair.few.b.mean).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((pair.all.b.covariance - pair.few.b.covariance).norm(),
              1e-3 * pair.all.b.covariance.norm());
  });
}

TEST(BlockMeans, OverloadIsFlagged) {
  Scenario scene = load("cell", {"contact={law: none}"});
  StrainMeans means;
  SimulatedCell relaxed(scene, CellParameters{});
  ASSERT_EQ(relaxed.average(means, 0.0, false), StopReason::kOk);
  EXPECT_FALSE(means.saturated);
  // the coupling stretched far beyond what its bridge can show
  scene.initial.position += Eigen::Vector3d(0.02, 0.0, 0.05);
  SimulatedCell cell(scene, CellParameters{});
  ASSERT_EQ(cell.average(means, 0.0, false), StopReason::kOk);
  EXPECT_TRUE(means.saturated);
  EXPECT_TRUE(means.b.mean.allFinite());
  EXPECT_LE(means.b.mean.cwiseAbs().maxCoeff(), 5.01);
}

}  // namespace
}  // namespace assembly_cell
