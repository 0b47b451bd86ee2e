// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The two accelerometers on the simulated peg: against differences of its motion, and the locus
// computed from them against the peg's own.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/locus/integrate_twice.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDrive = 770.0;

// hanging free: no contact, no events
Scenario swinging() {
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml",
                      {"contact.law=none", "exciter.amplitude=1", "exciter.frequency=770",
                       "solver.tolerance=1e-12"});
}

// a point on the peg's axis, `height` above its centre of mass
Vector3d pointOf(const SimulatorBackend& s, double height) {
  const Pose X = s.pegPose();
  return X.p + (s.scenario().mechanism.peg.half_height + height) * X.R.col(2);
}

TEST(Accelerometers, AreTheSecondDifferenceLessGravity) {
  for (const double height : {0.0, 0.02}) {
    CellParameters parameters;
    parameters.sample_period = 1e-5;
    parameters.block_size = 1;
    parameters.accelerometer_noise = 0.0;
    parameters.accelerometer_height = height;
    SimulatedCell cell(swinging(), parameters);
    StrainBlock block;
    std::vector<Vector3d> points;
    std::vector<Vector2d> measured;
    std::vector<Eigen::Matrix3d> axes;
    for (int k = 0; k < 400; ++k) {
      ASSERT_EQ(cell.next(block, true), StopReason::kOk);
      ASSERT_EQ(block.accelerations.size(), 2u);
      points.push_back(pointOf(cell.world(), height));
      axes.push_back(cell.world().pegPose().R);
      measured.emplace_back(block.accelerations[0], block.accelerations[1]);
    }
    double largest = 0.0;
    for (std::size_t k = 300; k + 1 < points.size(); ++k) {
      const Vector3d a = (points[k + 1] - 2 * points[k] + points[k - 1]) / 1e-10;
      const Vector3d specific = axes[k].transpose() * (a + Vector3d(0, 0, 9.8));
      largest = std::max(largest, a.norm());
      // (ω dt)²/12 of the acceleration; rounding of positions 1e-17 and of the steps' error
      EXPECT_LT((measured[k] - specific.head<2>()).norm(), 1e-3 * largest + 1e-4) << k;
    }
    EXPECT_GT(largest, 0.5);
  }
}

// 16 bit and all: the bridges are the same with and without a reader of the accelerometers
TEST(Accelerometers, LeaveTheBridgesAsTheyAre) {
  SimulatedCell with(swinging(), {}), without(swinging(), {});
  StrainBlock a, b;
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(with.next(a, true), StopReason::kOk);
    ASSERT_EQ(without.next(b), StopReason::kOk);
    EXPECT_EQ(a.volts_a, b.volts_a);
    EXPECT_EQ(a.volts_b, b.volts_b);
    EXPECT_TRUE(b.accelerations.empty());
    EXPECT_EQ(a.accelerations.size(), 2 * a.saturated_b.size());
  }
}

// the locus by double integration is that of the point's own motion
TEST(Accelerometers, TellTheLocus) {
  SimulatedCell cell(swinging(), {});
  StrainBlock block;
  for (int k = 0; k < 50; ++k) ASSERT_EQ(cell.next(block), StopReason::kOk);  // 1 s: settled
  std::vector<double> angle, measured, moved, series;
  for (int k = 0; k < 10; ++k) {
    const double before = cell.world().time();
    ASSERT_EQ(cell.next(block, true), StopReason::kOk);
    for (std::size_t i = 0; i < block.saturated_b.size(); ++i) {
      angle.push_back(kDrive * (before + block.period * static_cast<double>(i + 1)));
      measured.insert(measured.end(),
                      {block.accelerations[2 * i], block.accelerations[2 * i + 1], 0, 0, 0, 0});
      series.push_back(block.accelerations[2 * i]);
    }
  }
  // the ground truth, sample by sample, of a second cell in the same state
  CellParameters one;
  one.block_size = 1;
  SimulatedCell ground_truth(swinging(), one);
  for (int k = 0; k < 6000; ++k) {
    ASSERT_EQ(ground_truth.next(block), StopReason::kOk);
    if (k < 5000) continue;
    const Vector3d p = pointOf(ground_truth.world(), 0.0);
    moved.insert(moved.end(), {p.x(), p.y(), 0, 0, 0, 0});
  }
  const Locus expected = locusFromFit(fitHarmonic(angle, moved));
  const HarmonicFit fit = fitHarmonic(angle, measured);
  const double w2 = kDrive * kDrive;
  const Locus found = locusFromPhasors(-fit.phasor[0] / w2, -fit.phasor[1] / w2, 0, 1000, 1);
  // noise of 0.02 m/s² over ω² and the root of 1000 samples, five times; the peg's tilt of 1°,
  // whose axes the accelerometers have, and the swing in gravity, g over ω² and the lever: a
  // thousandth
  const double tolerance = 5 * 0.02 / w2 / std::sqrt(1000.0) + 1e-3 * expected.semiMajor();
  EXPECT_LT(std::abs(found.P - expected.P), tolerance);
  EXPECT_LT(std::abs(found.N - expected.N), tolerance);
  EXPECT_GT(expected.semiMajor(), 20 * tolerance);
  // and as a series
  const std::vector<double> x = integrateTwice(series, 5000, kDrive / 2);
  double squares = 0.0, size = 0.0, mean = 0.0;
  for (std::size_t k = 250; k < 750; ++k) mean += moved[6 * k] / 500;
  for (std::size_t k = 250; k < 750; ++k) {
    squares += std::pow(x[k] - (moved[6 * k] - mean), 2);
    size += std::pow(moved[6 * k] - mean, 2);
  }
  EXPECT_LT(squares, 0.02 * size);
}

}  // namespace
}  // namespace assembly_cell
