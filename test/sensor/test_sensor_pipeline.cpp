// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The driver's data path without ROS: wrenches, bias, averages and statistics of a stream.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "assembly_cell/sensor/sensor_pipeline.h"

namespace assembly_cell {
namespace {

constexpr std::size_t kBlockSamples = 10;
constexpr double kSamplePeriod = 1e-3;

class SensorStage : public testing::Test {
 protected:
  SensorStage() {
    Calibration c;
    c.volts_to_wrench = 10.0 * Matrix6::Identity();
    pipeline_.setCalibration(c);
  }
  SensorPipeline::Result process(std::uint32_t sequence, double volts) {
    values_.assign(6 * kBlockSamples, volts);
    BridgeBlock block;
    block.samples = {values_.data(), marks_.data(), kBlockSamples};
    block.sequence = sequence;
    block.start = sequence * kBlockSamples * kSamplePeriod;
    block.period = kSamplePeriod;
    end_ = block.end();
    return pipeline_.process(block, wrenches_, saturated_);
  }

  SensorPipeline pipeline_;
  std::vector<double> values_, wrenches_;
  std::vector<std::uint8_t> marks_ = std::vector<std::uint8_t>(kBlockSamples), saturated_;
  double end_ = 0.0;
};

TEST_F(SensorStage, SubtractsTheBiasFromSamplesButNotFromAverages) {
  pipeline_.setBias(Vector6::Constant(2.0));
  ASSERT_EQ(process(0, 0.5), SensorPipeline::Result::kDone);
  EXPECT_EQ(wrenches_, std::vector<double>(6 * kBlockSamples, 3.0));
  const auto average = pipeline_.takeAverage(end_, 0.1, kSamplePeriod);
  ASSERT_TRUE(average);
  EXPECT_EQ(average->wrench, Vector6::Constant(5.0).eval());
  // the next one is due 0.1 s later
  process(1, 0.5);
  EXPECT_FALSE(pipeline_.takeAverage(end_, 0.1, kSamplePeriod));
}

TEST_F(SensorStage, AZeroUsesOnlyBlocksThatBeganAfterTheRequest) {
  process(0, 0.1);
  pipeline_.zero() = ZeroMeasurement();
  pipeline_.zero().active = true;
  process(1, 0.2);
  EXPECT_EQ(pipeline_.zero().moments.count(), 0U);
  process(2, 0.3);
  EXPECT_EQ(pipeline_.zero().moments.count(), kBlockSamples);
  EXPECT_NEAR(pipeline_.zero().moments.mean()(0), 3.0, 1e-12);
  marks_[0] = 1;
  process(3, 0.3);
  EXPECT_NE(pipeline_.zero().failure.find("channel 1 saturated"), std::string::npos);
}

TEST_F(SensorStage, CountsLossesDuplicatesAndMalformedBlocks) {
  process(0, 0.1);
  process(3, 0.1);
  EXPECT_EQ(process(3, 0.1), SensorPipeline::Result::kDuplicate);
  EXPECT_EQ(process(4, std::numeric_limits<double>::max()), SensorPipeline::Result::kNotFinite);
  const StreamReport report = pipeline_.statistics().report();
  EXPECT_EQ(report.lost, 2U);
  EXPECT_EQ(report.duplicates, 1U);
  EXPECT_TRUE(report.malformed);
  EXPECT_EQ(report.total_samples, 3 * kBlockSamples);
  // of the next interval
  EXPECT_EQ(pipeline_.statistics().report().lost, 0U);
  EXPECT_EQ(pipeline_.statistics().report().total_lost, 2U);
}

TEST_F(SensorStage, ABlockThatIsNotFiniteKeepsTheCompleteEstimateOfTheNoise) {
  std::uint32_t sequence = 0;
  while (sequence < 10) process(sequence++, 0.1);
  const std::size_t complete = pipeline_.statistics().report().noise_samples;
  ASSERT_GE(complete, 50U);
  ASSERT_EQ(process(sequence++, std::numeric_limits<double>::max()),
            SensorPipeline::Result::kNotFinite);
  process(sequence++, 0.1);
  EXPECT_EQ(pipeline_.statistics().report().noise_samples, complete);
}

}  // namespace
}  // namespace assembly_cell
