// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/averaging_window.h"
#include "assembly_cell/align/estimation/contact_window.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

using namespace assembly_cell;
using Eigen::Vector3d;

namespace {

std::vector<double> samples(const Vector6& mean, double sd, std::size_t n, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sd);
  std::vector<double> out;
  for (std::size_t i = 0; i < 6 * n; ++i) {
    out.push_back(mean(static_cast<Eigen::Index>(i % 6)) + (sd > 0.0 ? normal(random) : 0.0));
  }
  return out;
}

}  // namespace

TEST(ContactWindow, MomentsAreThoseOfTheSamples) {
  // two samples by hand: mean in the middle, covariance d dᵀ / 2
  std::vector<double> two = {1, 2, 3, 4, 5, 6, 3, 2, 1, 0, -1, -2};
  const BlockMoments m = momentsOf(two.data(), 2);
  Vector6 mean, d;
  mean << 2, 2, 2, 2, 2, 2;
  d << 2, 0, -2, -4, -6, -8;
  EXPECT_LT((m.mean - mean).norm(), 1e-15);
  EXPECT_LT((m.covariance - 0.5 * d * d.transpose()).norm(), 1e-13);
  EXPECT_EQ(momentsOf(two.data(), 0).count, 0);
  EXPECT_EQ(momentsOf(two.data(), 1).covariance.norm(), 0.0);
}

TEST(ContactWindow, MeanAndCovarianceOfBlocksOfDifferentSize) {
  Vector6 load;
  load << 1, -2, 15, 0.1, 0.2, -0.3;
  ContactWindow w;
  for (unsigned k = 0; k < 8; ++k) {
    const std::size_t n = k % 2 == 0 ? 100 : 50;
    const auto a = samples(load, 0.01, n, k), b = samples(-load, 0.02, n, 100 + k);
    w.add(momentsOf(a.data(), n), momentsOf(b.data(), n), Vector6::Constant(1e-3));
  }
  EXPECT_EQ(w.samples(), 600);
  // 6 sd of the mean
  EXPECT_LT((w.wrenchA() - load).cwiseAbs().maxCoeff(), 6 * 0.01 / std::sqrt(600.0));
  EXPECT_LT((w.wrenchB() + load).cwiseAbs().maxCoeff(), 6 * 0.02 / std::sqrt(600.0));
  EXPECT_LT((w.displacement() - Vector6::Constant(1e-3)).norm(), 1e-15);
  // relative scatter of a variance of 600 samples: sqrt(2/600), 6 sd of it
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(w.covarianceA()(i, i) * 600 / 1e-4, 1.0, 6 * std::sqrt(2.0 / 600));
    EXPECT_NEAR(w.covarianceB()(i, i) * 600 / 4e-4, 1.0, 6 * std::sqrt(2.0 / 600));
  }
  EXPECT_TRUE(w.settled(1e-6));
}

TEST(ContactWindow, ADriftIsNotSettled) {
  for (const double drift : {0.0, 0.05}) {
    ContactWindow w;
    EXPECT_FALSE(w.settled(1.0));
    for (unsigned k = 0; k < 10; ++k) {
      Vector6 load = Vector6::Zero();
      load(4) = 0.1 * drift * k;  // of a torque, lever 0.1 m
      const auto a = samples(load, 1e-3, 100, k), b = samples(Vector6::Zero(), 1e-3, 100, 50 + k);
      w.add(momentsOf(a.data(), 100), momentsOf(b.data(), 100), Vector6::Zero());
    }
    EXPECT_EQ(w.settled(0.02), drift == 0.0);
  }
}

TEST(ContactWindow, RoundingIsThatOfUniformErrors) {
  // S = 2: sd 2 q / sqrt(12)
  const Matrix6 r = roundingCovariance(2.0 * Matrix6::Identity(), 0.3);
  EXPECT_NEAR(r(2, 2), 4.0 * 0.09 / 12, 1e-15);
  EXPECT_EQ(r(0, 1), 0.0);
}

TEST(PegWeight, HangsUnderTheCoupling) {
  PegParameters peg;
  peg.mass = 0.4;
  peg.coupling_height = 0.05;
  // upright: no torque
  Vector6 w = pegWeight(peg, 10.0, Vector3d::UnitZ(), Vector6::Zero());
  EXPECT_NEAR(w(2), -4.0, 1e-15);
  EXPECT_LT(w.tail<3>().norm(), 1e-15);
  // coupling pushed along x: torque of 4 N at 2 mm about y
  Vector6 d = Vector6::Zero();
  d(0) = 2e-3;
  w = pegWeight(peg, 10.0, Vector3d::UnitZ(), d);
  EXPECT_NEAR(w(4), 4.0 * 2e-3, 1e-15);
  // turned by t about y: the centre of mass goes to −L sin t
  d.setZero();
  d(4) = 0.1;
  w = pegWeight(peg, 10.0, Vector3d::UnitZ(), d);
  EXPECT_NEAR(w(4), -4.0 * 0.05 * std::sin(0.1), 1e-15);
  // gravity seen from a tilted carrier
  w = pegWeight(peg, 10.0, Vector3d(0.6, 0.0, 0.8), Vector6::Zero());
  EXPECT_NEAR(w(0), -2.4, 1e-15);
  EXPECT_NEAR(w(4), -0.05 * -2.4, 1e-15);
}

// Encoders that scatter are no motion; a drift or a step beyond their scatter is, and a
// large swing is no scatter.
TEST(AveragingWindow, DistinguishesMotionFromScatter) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  // windows of 10 blocks that count as moved: the carrier's x from block to block, and its scatter
  const auto moved = [&](double sd, int windows, const auto& way) {
    int count = 0;
    for (int run = 0; run < windows; ++run) {
      AveragingLimits limits;
      limits.blocks = 10;
      limits.settled_force = 1.0;
      limits.carrier_motion = 1e-5;
      AveragingWindow window(limits);
      AveragingWindow::State state{};
      for (int i = 0; i < limits.blocks; ++i) {
        PlantBlock block;
        block.time = 0.02 * (i + 1);
        block.carrier = {way(i) + sd * normal(random), sd * normal(random),
                         0.1 + sd * normal(random),    sd * normal(random),
                         sd * normal(random),          sd * normal(random)};
        state = window.add(block);
      }
      count += state == AveragingWindow::State::kMoved;
    }
    return count;
  };
  const auto still = [](int) { return 0.0; };
  const auto drift = [](double way) { return [way](int i) { return way * i / 9.0; }; };
  const auto jump = [](double way) { return [way](int i) { return i < 5 ? 0.0 : way; }; };
  EXPECT_EQ(moved(0.0, 1, still), 0);
  EXPECT_EQ(moved(0.0, 1, drift(9e-6)), 0);
  EXPECT_EQ(moved(0.0, 1, drift(1.1e-5)), 1);
  EXPECT_EQ(moved(0.0, 1, jump(1.1e-5)), 1);
  // 1 of 5000 and less of each level's scatter
  for (const double sd : {5e-6, 1e-5, 2e-5}) {
    EXPECT_LE(moved(sd, 2000, still), 4) << sd;
    EXPECT_EQ(moved(sd, 100, drift(10 * sd + 1e-5)), 100) << sd;
    EXPECT_EQ(moved(sd, 100, jump(8 * sd + 1e-5)), 100) << sd;
  }
  EXPECT_EQ(moved(0.0, 1, [](int i) { return i % 2 ? 3e-4 : 0.0; }), 1);
}
