// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Bags with wrong bytes: the source plays the valid part or reports the damage in one line,
// whatever rosbag's decompression does.

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>

#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/bag_check.h"
#include "assembly_cell/ros/driver/bag_source.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge::damaged_bags_test {
namespace {

class DamagedBags : public ::testing::TestWithParam<rosbag::CompressionType> {
 protected:
  static constexpr int kBlocks = 40, kSamples = 20;

  DamagedBags() {
    rosbag::Bag bag(path_, rosbag::bagmode::Write);
    bag.setCompression(GetParam());
    bag.setChunkThreshold(4096);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> volts(-5.0, 5.0);
    StrainSamples block;
    block.period = 2e-4;
    block.saturated.assign(kSamples, 0);
    block.volts.resize(6 * kSamples);
    for (int k = 0; k < kBlocks; ++k) {
      block.header.stamp = ros::Time(100.0 + k * kSamples * block.period);
      block.sequence = static_cast<std::uint32_t>(k);
      for (double& v : block.volts) v = volts(random);
      bag.write("strain", block.header.stamp, block);
    }
    bag.close();
    std::ifstream in(path_, std::ios::binary);
    whole_.assign(std::istreambuf_iterator<char>(in), {});
  }
  void write(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
  }

  // samples that the source plays, or the line that it reports
  std::size_t play(std::string& line) {
    BagSource source;
    YAML::Node map;
    map["file"] = path_;
    map["rate"] = "fast";
    source.configure(map);
    std::size_t samples = 0;
    try {
      source.open();
      const auto block = std::make_unique<SourceBlock>();
      while (source.read(*block, std::chrono::seconds(60)) == ReadResult::kSamples) {
        for (std::size_t k = 0; k < 6 * block->count; ++k) {
          EXPECT_TRUE(std::isfinite(block->values[k]));
        }
        samples += block->count;
      }
    } catch (const InputError& error) {
      line = error.what();
    } catch (const SourceError& error) {
      line = error.what();
    }
    return samples;
  }

  const test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "run.bag";
  std::string whole_;
};

TEST_P(DamagedBags, AnIntactBagIsPlayed) {
  std::string line;
  EXPECT_EQ(play(line), static_cast<std::size_t>(kBlocks * kSamples));
  EXPECT_EQ(line, "");
}

TEST_P(DamagedBags, NoDamageAbortsOrHangs) {
  std::mt19937 random(7);
  int refused = 0;
  const int cases = 60;
  for (int seed = 0; seed < cases; ++seed) {
    std::string bytes = whole_;
    // one byte, some, or the end cut off
    const int bad = seed % 3 == 0 ? 1 : 20;
    for (int k = 0; k < bad; ++k) {
      bytes[random() % bytes.size()] = static_cast<char>(random() % 256);
    }
    if (seed % 5 == 4) bytes.resize(random() % bytes.size());
    write(bytes);
    std::string line;
    const std::size_t samples = play(line);
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    EXPECT_LT(line.size(), 500u) << line;
    EXPECT_TRUE(samples > 0 || !line.empty()) << "seed " << seed << ": no line";
    EXPECT_LE(samples, static_cast<std::size_t>(kBlocks * kSamples));
    if (line.empty()) continue;
    ++refused;
    EXPECT_NE(line.find("run.bag"), std::string::npos) << line;
  }
  EXPECT_GT(refused, cases / 4);
}

TEST_P(DamagedBags, ABagThatIsCutWhileItIsPlayedIsNoEndOfTheRecording) {
  BagSource source;
  YAML::Node map;
  map["file"] = path_;
  map["rate"] = "fast";
  source.configure(map);
  source.open();
  const auto block = std::make_unique<SourceBlock>();
  ASSERT_EQ(source.read(*block, std::chrono::seconds(60)), ReadResult::kSamples);
  std::filesystem::resize_file(path_, whole_.size() / 4);
  ReadResult last = ReadResult::kSamples;
  while (last == ReadResult::kSamples) last = source.read(*block, std::chrono::seconds(60));
  EXPECT_EQ(last, ReadResult::kLost);
  EXPECT_NE(source.lostReason().find("run.bag' can't be read any more"), std::string::npos)
      << source.lostReason();
}

INSTANTIATE_TEST_SUITE_P(Compressions, DamagedBags,
                         ::testing::Values(rosbag::compression::Uncompressed,
                                           rosbag::compression::BZ2, rosbag::compression::LZ4));

}  // namespace
}  // namespace assembly_cell::ros_bridge::damaged_bags_test
