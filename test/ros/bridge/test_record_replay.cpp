// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/LocusEstimate.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "driver_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::test::record_replay_test {
namespace {

constexpr double kTwoPi = 6.283185307179586;

// All bits except header.seq, which ROS counts by itself.
std::vector<std::uint8_t> bits(LocusEstimate estimate) {
  estimate.header.seq = 0;
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(estimate));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, estimate);
  return bytes;
}

std::map<ros::Time, std::vector<std::uint8_t>> byStamp(const Record<LocusEstimate>& record) {
  std::map<ros::Time, std::vector<std::uint8_t>> all;
  for (const auto& estimate : record.all()) all[estimate->header.stamp] = bits(*estimate);
  return all;
}

// A run of a sensor under an exciter, live, recorded, and played again three times.
class RecordReplay : public ::testing::Test {
 protected:
  void exciter(ros::Publisher& publisher, bool on, double frequency) {
    Exciter message;
    message.header.stamp = ros::Time::now();
    message.on = on;
    message.amplitude = 1.0;
    message.frequency = frequency;
    message.direction = 1;
    publisher.publish(message);
  }

  // plays the bag and returns the estimates; late: to a listener that connects in the middle
  std::map<ros::Time, std::vector<std::uint8_t>> replay(const std::string& ns,
                                                        const std::string& rate,
                                                        bool late = false) {
    Record<DisplacementSamples> blocks(nh_, "/" + ns + "/sensor_b/displacement_samples");
    Record<Exciter> exciters(nh_, "/" + ns + "/exciter");
    std::optional<Record<LocusEstimate>> loci;
    if (!late) loci.emplace(nh_, "/" + ns + "/locus");
    Child player({"roslaunch", "assembly_cell", "replay.launch", "bag:=" + bag_, "ns:=/" + ns,
                  "recorded_ns:=/live", "clock:=false", "rate:=" + rate});
    if (late) {
      EXPECT_TRUE(waitFor([&] { return exciters.size() > 0; })) << player.output();
      // the exciter's first samples have left the window of 10 blocks
      const std::size_t started = blocks.size();
      EXPECT_TRUE(waitFor([&] { return blocks.size() > started + 15; })) << player.output();
      loci.emplace(nh_, "/" + ns + "/locus");
    }
    EXPECT_EQ(player.wait(), 0) << player.output();
    EXPECT_EQ(player.lines("the bag is over").size(), 1u) << player.output();
    return byStamp(*loci);
  }

  ros::NodeHandle nh_;
  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_.path();
  std::string bag_ = folder_ + "/run.bag";
};

TEST_F(RecordReplay, TheSameBagHasTheSameEstimatesToTheLastBit) {
  ros::Publisher exciters = nh_.advertise<Exciter>("/live/exciter", 100, true);
  Record<LocusEstimate> live(nh_, "/live/locus");
  Record<DisplacementSamples> blocks(nh_, "/live/sensor_b/displacement_samples");
  {
    Child recorder({"roslaunch", "assembly_cell", "record.launch", "bag:=" + bag_, "ns:=/live"});
    Child estimator({executable("locus_estimator"), "__ns:=/live", "__name:=locus_estimator",
                     "_scenario:=" + sourceFile("config/scenarios/cell.yaml")});
    // the exciter's subscribers are these two
    ASSERT_TRUE(waitFor([&] { return exciters.getNumSubscribers() >= 2; })) << recorder.output();
    const double frequency = 120.0;  // [Hz]
    // a command line can't give a list
    const std::string source = "/live/sensor_b/driver/source/";
    ros::param::set(source + "load", std::vector<double>{0, 0, 12, 0, 0, 0});
    ros::param::set(source + "amplitude", std::vector<double>{1, 0.5, 0.2, 0, 0, 0});
    Driver driver("live/sensor_b",
                  {"_source/type:=simulated", "_source/bridge:=b", "_source/block_size:=100",
                   "_source/frequency:=" + std::to_string(frequency), "_publish_displacement:=true",
                   "_calibration_file:=" + sourceFile("config/calibration/sensor_b.yaml")});
    ASSERT_TRUE(waitFor([&] { return blocks.size() > 60 && live.connected(); })) << driver.output();

    // on, another frequency, off, on, while blocks continue
    exciter(exciters, true, kTwoPi * frequency);
    ASSERT_TRUE(waitFor([&] { return live.size() > 30; })) << estimator.output();
    exciter(exciters, true, kTwoPi * 1.01 * frequency);
    const std::size_t changed = blocks.size();
    ASSERT_TRUE(waitFor([&] { return blocks.size() > changed + 30; }));
    exciter(exciters, false, kTwoPi * frequency);
    ASSERT_TRUE(waitFor([&] { return blocks.size() > changed + 40; }));
    exciter(exciters, true, kTwoPi * frequency);
    ASSERT_TRUE(waitFor([&] { return blocks.size() > changed + 125; }));
    recorder.stop();
  }
  ASSERT_TRUE(std::filesystem::exists(bag_));

  const auto first = replay("replay_1", "original");
  EXPECT_GT(first.size(), 40u);
  // the player waits for the listener, as fast as possible too
  EXPECT_EQ(replay("replay_2", "fast"), first);

  const auto rest = replay("replay_3", "original", true);
  EXPECT_GT(rest.size(), 0u);
  for (const auto& [stamp, estimate] : rest) {
    const auto other = first.find(stamp);
    ASSERT_NE(other, first.end());
    EXPECT_EQ(estimate, other->second);
  }

  // also to the live run, except where a change of the exciter arrived between other blocks
  const auto at_once = byStamp(live);
  std::size_t equal = 0, shared = 0;
  for (const auto& [stamp, estimate] : at_once) {
    const auto other = first.find(stamp);
    if (other == first.end()) continue;
    ++shared;
    equal += estimate == other->second;
  }
  EXPECT_GT(shared, 40u);
  EXPECT_GE(equal + 6, shared);
}

// One line each, and exit code 1.
TEST_F(RecordReplay, RefusesABadBagInOneLine) {
  Child none({executable("cell_player"), "__name:=no_bag", "_bag:=/none.bag", "_topics:=exciter"});
  EXPECT_EQ(none.wait(), 1);
  EXPECT_TRUE(has(none.output(), "bag '/none.bag' can't be read")) << none.output();

  {
    rosbag::Bag bag(bag_, rosbag::bagmode::Write);
    bag.write("/exciter", ros::Time(1.0), Exciter());
  }
  Child silent({executable("cell_player"), "__name:=no_topic", "_bag:=" + bag_, "_topics:=exciter",
                "_participants:=missing=exciter", "_start_timeout:=0.3"});
  EXPECT_EQ(silent.wait(), 1);
  EXPECT_TRUE(has(silent.output(), "no connection to /missing")) << silent.output();

  Child foreign({executable("cell_player"), "__name:=foreign", "_bag:=" + bag_, "_topics:=exciter",
                 "_recorded_namespace:=/other"});
  EXPECT_EQ(foreign.wait(), 1);
  EXPECT_TRUE(has(foreign.output(), "set recorded_namespace")) << foreign.output();
}

}  // namespace
}  // namespace assembly_cell::test::record_replay_test
