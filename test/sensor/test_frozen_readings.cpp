// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/frozen_readings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/sensor_pipeline.h"

namespace assembly_cell {
namespace {

using Sample = std::array<double, 6>;

constexpr Sample kReading = {1.0, -2.0, 3.0, 0.1, -0.2, 0.3};

void repeat(FrozenReadings& frozen, const Sample& sample, int count, double period) {
  for (int i = 0; i < count; ++i) frozen.add(sample.data(), period);
}

TEST(FrozenReadings, AreReportedAfterFiftySamplesAndFrozenAfterASecond) {
  FrozenReadings frozen;
  frozen.setLimit(1.0);
  repeat(frozen, kReading, 49, 1e-3);
  EXPECT_EQ(frozen.report(), "");
  repeat(frozen, kReading, 1, 1e-3);
  EXPECT_NE(frozen.report().find("exactly the same reading"), std::string::npos);
  EXPECT_FALSE(frozen.isFrozen());
  repeat(frozen, kReading, 951, 1e-3);
  EXPECT_TRUE(frozen.isFrozen());
  EXPECT_EQ(frozen.describe(),
            "all six channels have had exactly the same reading for 1 s (1001 samples)");
  // one bit of one channel
  Sample moved = kReading;
  moved[4] = std::nextafter(moved[4], 0.0);
  repeat(frozen, moved, 1, 1e-3);
  EXPECT_FALSE(frozen.isFrozen());
  // each report counts since the one before
  EXPECT_NE(frozen.report().find("1001 samples in a row"), std::string::npos);
  EXPECT_EQ(frozen.report(), "");
}

TEST(FrozenReadings, ASlowDeviceMustRepeatFiftySamplesToo) {
  FrozenReadings frozen;
  frozen.setLimit(1.0);
  repeat(frozen, kReading, 49, 0.1);
  EXPECT_FALSE(frozen.isFrozen());
  repeat(frozen, kReading, 1, 0.1);
  EXPECT_TRUE(frozen.isFrozen());
}

TEST(FrozenReadings, ZerosAreNamed) {
  FrozenReadings frozen;
  frozen.setLimit(1.0);
  repeat(frozen, Sample{}, 2000, 1e-3);
  EXPECT_EQ(frozen.describe(), "all six channels have read exactly zero for 2 s (2000 samples)");
}

TEST(FrozenReadings, WithoutALimitNothingIsReported) {
  FrozenReadings frozen;
  repeat(frozen, kReading, 100000, 1e-3);
  EXPECT_FALSE(frozen.isFrozen());
  EXPECT_EQ(frozen.report(), "");
  EXPECT_FALSE(frozen.covers(1));
}

// The cell's bridges at rest: 0.5 mV of noise is 3.3 steps of 16 bit.
TEST(FrozenReadings, ASimulatedConverterMovesUnlessItHasNoNoise) {
  struct Case {
    int bits;
    double noise;
    bool is_frozen;
  };
  for (const Case& c :
       {Case{16, 0.5e-3, false}, {24, 0.5e-3, false}, {16, 0.0, true}, {10, 0.0, true}}) {
    const Bridge bridge = bridgeA(c.bits, c.noise);
    const Matrix6 strain = strainMatrix(bridge);
    NormalSource normal(1);
    FrozenReadings frozen;
    frozen.setLimit(1.0);
    std::size_t longest = 0;
    for (int i = 0; i < 20000; ++i) {
      const StrainSample sample = convert(bridge, strain, Vector6::Zero(), normal);
      frozen.add(sample.volts.data(), 2e-4);
      longest = std::max(longest, frozen.run());
    }
    EXPECT_EQ(frozen.isFrozen(), c.is_frozen) << c.bits;
    EXPECT_EQ(longest >= FrozenReadings::kReported, c.is_frozen) << c.bits;
  }
}

TEST(FrozenReadings, EndAZeroThatIsUnderWay) {
  SensorPipeline pipeline;
  Calibration c;
  c.volts_to_wrench.setIdentity();
  pipeline.setCalibration(c);
  pipeline.frozen().setLimit(1.0);
  pipeline.zero().active = true;
  std::vector<double> values, wrenches;
  std::vector<std::uint8_t> marks(100), saturated;
  for (int i = 0; i < 100; ++i) values.insert(values.end(), kReading.begin(), kReading.end());
  BridgeBlock block;
  block.samples = {values.data(), marks.data(), 100};
  block.period = 1e-3;
  for (std::uint32_t n = 1; n <= 10; ++n) {
    block.sequence = n;
    block.start = 0.1 * n;
    pipeline.process(block, wrenches, saturated);
    EXPECT_EQ(pipeline.zero().failure, "") << n;
  }
  block.sequence = 11;
  block.start = 1.1;
  pipeline.process(block, wrenches, saturated);
  EXPECT_NE(pipeline.zero().failure.find("is frozen: look at its power"), std::string::npos)
      << pipeline.zero().failure;
  EXPECT_NE(pipeline.zero().failure.find("frozen_after: 0"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
