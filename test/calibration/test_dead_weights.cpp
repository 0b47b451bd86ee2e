// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/dead_weights/dead_weights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// six blocks of nine weights and none, at the sensor and on an arm, through a map near unity
std::vector<DeadWeight> hung() {
  const double masses[] = {0.0, 0.06, 0.145, 0.205, 0.285, 0.4, 0.685, 1.155, 1.62, 2.21};
  const std::pair<Vector3d, Vector3d> loads[] = {
      {Vector3d::UnitY(), Vector3d::Zero()},  {Vector3d::UnitY(), {0, 0, 0.15}},
      {-Vector3d::UnitX(), Vector3d::Zero()}, {-Vector3d::UnitX(), {0, 0, 0.15}},
      {-Vector3d::UnitX(), {0, -0.15, 0}},    {-Vector3d::UnitZ(), Vector3d::Zero()}};
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Matrix6 map = Matrix6::Identity();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) map(i, j) += 0.02 * normal(random);
  }
  std::vector<DeadWeight> rows;
  for (const auto& [direction, arm] : loads) {
    for (const double mass : masses) {
      Vector6 w;
      w << 9.81 * mass * direction, arm.cross(Vector3d(9.81 * mass * direction));
      DeadWeight row;
      row.label = w;
      row.reading = map * w;
      for (int k = 0; k < 6; ++k) {
        row.reading[k] += (k < 3 ? 0.015 + 0.002 * 9.81 * mass : 0.003) * normal(random);
      }
      row.line = rows.size() + 2;
      rows.push_back(row);
    }
  }
  return rows;
}

std::set<std::size_t> accused(const std::vector<DeadWeight>& rows) {
  std::set<std::size_t> out;
  for (const WrongLabel& w : solveDeadWeights(rows).wrong) out.insert(w.row);
  return out;
}

using Rows = std::set<std::size_t>;

TEST(DeadWeights, CleanLabelsAreLeftAlone) {
  const DeadWeightSolution s = solveDeadWeights(hung());
  EXPECT_TRUE(s.wrong.empty());
  EXPECT_EQ(s.blocks, 6u);
  EXPECT_EQ(s.rank, 6);
  EXPECT_TRUE(s.missing.empty());
  EXPECT_LT(s.left_out_rms.head<3>().maxCoeff(), 0.06);
  EXPECT_FALSE(s.block_possible);  // each moment hangs in one block only
}

TEST(DeadWeights, SwappedRowsAreNamed) {
  std::vector<DeadWeight> rows = hung();
  std::swap(rows[13].label, rows[14].label);  // neighbours
  std::swap(rows[25].label, rows[48].label);  // blocks apart
  std::swap(rows[50].label, rows[51].label);  // with none
  EXPECT_EQ(accused(rows), (Rows{13, 14, 25, 48, 50, 51}));
}

TEST(DeadWeights, SwappedForcesAndMomentsAreNamed) {
  std::vector<DeadWeight> rows = hung();
  const Vector3d force = rows[15].label->head<3>();
  rows[15].label->head<3>() = rows[16].label->head<3>().eval();
  rows[16].label->head<3>() = force;
  const Vector3d moment = rows[38].label->tail<3>();
  rows[38].label->tail<3>() = rows[39].label->tail<3>().eval();
  rows[39].label->tail<3>() = moment;
  EXPECT_EQ(accused(rows), (Rows{15, 16, 38, 39}));
  const std::string text = solveDeadWeights(rows).wrong[0].text;
  EXPECT_EQ(text, "force reads as that of line 18");
}

TEST(DeadWeights, AWrongArmIsNamed) {
  std::vector<DeadWeight> rows = hung();
  rows[11].label->tail<3>().setZero();
  rows[37].label->tail<3>().setZero();
  rows[2].label->tail<3>() = Vector3d(0, 0, 0.15).cross(Vector3d(rows[2].label->head<3>()));
  EXPECT_EQ(accused(rows), (Rows{2, 11, 37}));
}

TEST(DeadWeights, MissingLoadsAreNamed) {
  std::vector<DeadWeight> rows = hung();
  rows.erase(rows.begin() + 40, rows.begin() + 50);  // the only torque about z
  const DeadWeightSolution s = solveDeadWeights(rows);
  EXPECT_EQ(s.rank, 5);
  ASSERT_EQ(s.missing.size(), 1u);
  EXPECT_EQ(s.missing[0].rfind("tz by itself", 0), 0u) << s.missing[0];
}

TEST(DeadWeights, ReadingsWithoutLabelAreRead) {
  std::vector<DeadWeight> rows = hung();
  const Vector6 ground_truth = *rows[17].label;
  rows[17].label.reset();
  const DeadWeightSolution s = solveDeadWeights(rows);
  ASSERT_EQ(s.unlabelled, std::vector<std::size_t>{17});
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(s.unlabelled_load[0][k], ground_truth[k], 5.0 * s.unlabelled_sd[0][k]) << k;
  }
  rows.resize(7);
  EXPECT_THROW(solveDeadWeights(rows), InputError);
}

TEST(DeadWeights, FrozenReadingsUnitsAndUnrelatedLoadsAreNamed) {
  const auto first = [](const std::vector<DeadWeight>& rows) {
    const std::vector<std::string> found = solveDeadWeights(rows).findings;
    return found.empty() ? std::string() : found.front();
  };
  const auto has = [](const std::string& text, const std::string& words) {
    EXPECT_NE(text.find(words), std::string::npos) << words << ": " << text;
  };
  EXPECT_EQ(first(hung()), "");
  std::vector<DeadWeight> rows = hung();
  for (DeadWeight& row : rows) row.reading[2] = 0.5;
  has(first(rows), "fz reads 0.5 in all rows");
  rows = hung();
  rows[5].reading = rows[6].reading;
  has(first(rows), "lines 7, 8: the same reading");
  rows = hung();
  for (DeadWeight& row : rows) row.label->tail<3>() *= 1e3;
  has(first(rows), "in N mm? Give N m");
  rows = hung();
  for (DeadWeight& row : rows) row.reading.head<3>() /= 9.80665;
  has(first(rows), "read in kgf");
  rows = hung();
  for (DeadWeight& row : rows) *row.label /= 9.80665;
  has(first(rows), "known ones in kgf");
  rows = hung();
  for (DeadWeight& row : rows) *row.label *= -1.0;
  has(first(rows), "opposite sign");
}

}  // namespace
}  // namespace assembly_cell
