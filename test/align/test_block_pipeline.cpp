// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The block that a strategy evaluates: from strain and from the drivers' wrenches.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "assembly_cell/align/estimation/block_pipeline.h"
#include "assembly_cell/align/estimation/sample_window.h"

namespace assembly_cell {
namespace {

constexpr double kStep = 10.0 / 65536.0, kSamplePeriod = 2e-4;
constexpr std::size_t kSamples = 20;

Calibration calibration(double gain) {
  Calibration c;
  c.volts_to_wrench = gain * Matrix6::Identity();
  c.volts_to_wrench(0, 4) = 0.1 * gain;
  c.volts_to_displacement = 1e-4 * Matrix6::Identity();
  c.zero_volts.setConstant(0.01);
  return c;
}

std::vector<double> strain(double offset) {
  std::vector<double> volts;
  for (std::size_t i = 0; i < 6 * kSamples; ++i) {
    volts.push_back(offset + 1e-3 * static_cast<double>((7 * i) % 13));
  }
  return volts;
}

template <class Map>
std::vector<double> mapped(const std::vector<double>& volts, const Map& map) {
  std::vector<double> out(volts.size());
  for (std::size_t i = 0; i < kSamples; ++i) {
    Vector6::Map(&out[6 * i]) = map(Vector6::Map(&volts[6 * i]));
  }
  return out;
}

class BlockStage : public testing::Test {
 protected:
  BlockStage() : pipeline_(kStep) {
    pipeline_.setCalibration(0, a_);
    pipeline_.setCalibration(1, b_);
  }
  PlantBlock fromStrain() const {
    return pipeline_.fromStrain(momentsOf(volts_a_.data(), kSamples),
                                momentsOf(volts_b_.data(), kSamples), false, kSamplePeriod);
  }
  // by the drivers' maps
  std::optional<PlantBlock> fromWrenches() const {
    const auto wrench_a =
        mapped(volts_a_, [&](const Vector6& v) { return wrenchFromVolts(a_, v); });
    const auto wrench_b =
        mapped(volts_b_, [&](const Vector6& v) { return wrenchFromVolts(b_, v); });
    const auto d = mapped(volts_b_, [&](const Vector6& v) { return displacementFromVolts(b_, v); });
    return pipeline_.fromWrenches({wrench_a.data(), nullptr, kSamples},
                                  {wrench_b.data(), saturated_.data(), kSamples},
                                  {d.data(), nullptr, kSamples}, kSamplePeriod);
  }

  Calibration a_ = calibration(100.0), b_ = calibration(50.0);
  std::vector<double> volts_a_ = strain(0.2), volts_b_ = strain(-0.1);
  std::vector<std::uint8_t> saturated_ = std::vector<std::uint8_t>(kSamples);
  BlockPipeline pipeline_;
};

// Maps are linear: to rounding it is the same whether moments or samples are mapped.
TEST_F(BlockStage, StrainAndWrenchesGiveTheSameBlock) {
  const PlantBlock strain = fromStrain();
  const PlantBlock wrenches = fromWrenches().value();
  EXPECT_LT((strain.wrench_a - wrenches.wrench_a).norm(), 1e-12);
  EXPECT_LT((strain.wrench_b - wrenches.wrench_b).norm(), 1e-12);
  EXPECT_LT((strain.displacement_b - wrenches.displacement_b).norm(), 1e-18);
  EXPECT_LT((strain.covariance_a - wrenches.covariance_a).norm(), 1e-12);
  EXPECT_LT((strain.covariance_b - wrenches.covariance_b).norm(), 1e-12);
  EXPECT_EQ(strain.rounding_b, wrenches.rounding_b);
  EXPECT_EQ(strain.rounding_b, roundingCovariance(b_.volts_to_wrench, kStep));
  EXPECT_EQ(strain.samples, static_cast<int>(kSamples));
  EXPECT_DOUBLE_EQ(strain.length, static_cast<double>(kSamples) * kSamplePeriod);
}

// An identified coupling replaces both the calibration's map and the driver's displacements.
TEST_F(BlockStage, ACouplingGivesTheDisplacements) {
  const Vector6 own = fromStrain().displacement_b;
  CouplingParameters coupling;
  coupling.stiffness.diagonal << 3e5, 2e5, 2e5, 50.0, 100.0, 100.0;
  pipeline_.setCoupling(&coupling);
  const PlantBlock strain = fromStrain();
  const Vector6 expected = couplingStiffness(coupling).inverse() * strain.wrench_b;
  EXPECT_LT((strain.displacement_b - expected).norm(), 1e-12 * expected.norm());
  EXPECT_LT((fromWrenches()->displacement_b - expected).norm(), 1e-12 * expected.norm());
  pipeline_.setCoupling(nullptr);
  EXPECT_EQ(fromStrain().displacement_b, own);
}

TEST_F(BlockStage, ReportsSaturationAndRefusesWhatIsNotFinite) {
  EXPECT_FALSE(fromWrenches()->saturated);
  saturated_[3] = 0x10;
  EXPECT_TRUE(fromWrenches()->saturated);
  volts_a_[7] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(fromWrenches());
}

// The samples in [start, start + duration), also those of a block that began before.
TEST(SampleWindow, TakesTheSamplesThatLieInIt) {
  std::vector<double> values(6 * kSamples);
  for (std::size_t i = 0; i < kSamples; ++i) values[6 * i] = static_cast<double>(i);
  ExciterParameters exciter;
  exciter.frequency = 100.0;
  exciter.phase = 0.5;
  exciter.direction = -1;
  SampleWindow window;
  window.begin({0.01 + 15 * kSamplePeriod, 10 * kSamplePeriod});
  const double end =
      0.01 + static_cast<double>(kSamples - 1) * kSamplePeriod;  // sample i at 0.01 + i T
  window.add(values.data(), kSamples, kSamplePeriod, end, exciter, 0.01);
  EXPECT_FALSE(window.endsBy(end));
  window.add(values.data(), kSamples, kSamplePeriod, end + kSamples * kSamplePeriod, exciter, 0.01);
  EXPECT_TRUE(window.endsBy(end + kSamples * kSamplePeriod));
  ASSERT_EQ(window.angles().size(), 10U);
  EXPECT_EQ(window.signals()[0], 15.0);
  EXPECT_EQ(window.signals()[6 * 5], 0.0);
  EXPECT_NEAR(window.angles()[0], -(100.0 * 15 * kSamplePeriod + 0.5), 1e-12);
}

}  // namespace
}  // namespace assembly_cell
