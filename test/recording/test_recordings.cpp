// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the recordings of docs/how_to/recordings.md say. They are others' and not in the package:
// the folder that holds them is named by ASSEMBLY_CELL_RECORDINGS, without it these tests are
// skipped.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "assembly_cell/calibration/dead_weights/dead_weights.h"
#include "assembly_cell/calibration/payload/payload_files.h"
#include "assembly_cell/calibration/reference/reference.h"
#include "assembly_cell/recording/contacts.h"
#include "assembly_cell/recording/tones.h"

namespace assembly_cell {
namespace {

class Recordings : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("ASSEMBLY_CELL_RECORDINGS");
    if (folder == nullptr) GTEST_SKIP() << "ASSEMBLY_CELL_RECORDINGS names no folder";
    folder_ = std::string(folder) + "/";
    if (!std::filesystem::is_directory(folder_ + "dead_weights")) {
      GTEST_SKIP() << folder_ << " holds no recordings";
    }
  }
  std::string folder_;
};

TEST_F(Recordings, EveryRunLeftOutIsPredictedBetterThanByLeastSquares) {
  std::vector<ReferenceRun> all;
  for (const char* run : {"sens1", "sens3", "sens4"}) {
    all.push_back(readReferenceRun(folder_ + "sensor_in_series/" + run + ".txt"));
  }
  for (std::size_t held = 0; held < all.size(); ++held) {
    std::vector<ReferenceRun> runs;
    for (std::size_t r = 0; r < all.size(); ++r) {
      if (r != held) runs.push_back(all[r]);
    }
    const ReferenceSolution s = solveReference(runs, &all[held], {});
    EXPECT_LT(s.hold_out->error.force, 0.92 * s.plain.force) << held;
    EXPECT_LT(s.hold_out->error.torque, 0.92 * s.plain.torque) << held;
  }
}

TEST_F(Recordings, DeadWeightsHaveTwoSwappedForces) {
  const auto lines = [&](const char* file) {
    std::vector<std::size_t> out;
    const std::vector<DeadWeight> rows = readDeadWeights(folder_ + "dead_weights/" + file);
    for (const WrongLabel& w : solveDeadWeights(rows).wrong) out.push_back(rows[w.row].line);
    return out;
  };
  EXPECT_TRUE(lines("calibrationReadings.csv").empty());
  EXPECT_EQ(lines("calibrationReadings_2.csv"), (std::vector<std::size_t>{17, 18}));
}

TEST_F(Recordings, TheShakerRunsAtItsFrequenciesAndStepsOnce) {
  const ChannelRecording first = readChannels(folder_ + "shaker_beam/forced_1.csv", {"drive_V"});
  const ToneAnalysis even = findTones(first.t, first.values[0]);
  ASSERT_EQ(even.tones.size(), 3u);
  for (const Tone& tone : even.tones) {
    EXPECT_NEAR(tone.frequency, 10.0 * std::round(tone.frequency / 10.0), 1e-3);
    EXPECT_NEAR(tone.amplitude[0], 0.4994, 0.0025);
  }
  const ChannelRecording second = readChannels(folder_ + "shaker_beam/forced_2.csv", {"drive_V"});
  const ToneAnalysis stepped = findTones(second.t, second.values[0]);
  ASSERT_EQ(stepped.steps.size(), 1u);
  EXPECT_NEAR(stepped.steps[0].time, 9.78, 0.02);
}

TEST_F(Recordings, AnotherArmsPayloadIsWhatItsAuthorsPublished) {
  const std::string path = folder_ + "kuka_ati_gamma/0-calibration_fts-accel.csv";
  const Poses poses = readPoses(path);
  const PlainPayload p = plainPayload(poses.values, readWrenches(path).values);
  EXPECT_TRUE(p.level);
  EXPECT_NEAR(p.gravity.norm() / *poses.gravity, 0.932, 0.0005);
  const Vector6 bias = p.bias;
  EXPECT_NEAR(p.center_of_mass.x(), 0.3e-3, 0.05e-3);
  EXPECT_NEAR(p.center_of_mass.y(), 0.05e-3, 0.01e-3);
  EXPECT_NEAR(p.center_of_mass.z(), 43.9e-3, 0.05e-3);
  EXPECT_NEAR(bias[0], 9.076, 0.001);
  EXPECT_NEAR(bias[1], -1.018, 0.001);
  EXPECT_NEAR(bias[2], 9.985, 0.001);
}

TEST_F(Recordings, PegsHaveOneLever) {
  double mean = 0.0;
  std::vector<double> levers;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ + "franka_peg")) {
    const ContactAnalysis a = findContacts(readWrenchRecording(entry.path().string()), {});
    levers.push_back(a.lever);
    mean += a.lever;
  }
  mean /= static_cast<double>(levers.size());
  double squares = 0.0;
  for (const double lever : levers) squares += std::pow(lever - mean, 2);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(levers.size() - 1)), 1.5e-3);
}

}  // namespace
}  // namespace assembly_cell
