// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/Exciter.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Header.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "cell_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge::exciter_output_test {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::sourceFile;
using test::waitFor;

/// The bridge: its sign of life, and the exciter commands that it has accepted.
class ExciterOutput : public ::testing::Test {
 protected:
  ExciterOutput()
      : path_(test::temporaryFile("exciter_output.raw")),
        done_(nh_, "arm/exciter_done"),
        speed_(nh_, "arm/exciter_speed"),
        diagnostics_(nh_, "/diagnostics"),
        exciter_(nh_.advertise<Exciter>("arm/exciter", 10, true)),
        pose_(nh_.advertise<geometry_msgs::PoseStamped>("carrier_pose", 10)) {
    beat_ = std::thread([this] {
      while (!quit_) {
        geometry_msgs::PoseStamped pose;
        pose.header.stamp = ros::Time::now();
        pose.header.frame_id = "carrier_base";
        pose.pose.orientation.w = 1.0;
        if (alive_) pose_.publish(pose);
        ros::WallDuration(0.02).sleep();
      }
    });
  }
  ~ExciterOutput() override {
    quit_ = true;
    beat_.join();
    ros::param::del("/exciter_output");
    std::remove(path_.c_str());
  }

  // the package of the example is among those that rospack sees
  void withExample() {
    const char* packages = std::getenv("ROS_PACKAGE_PATH");
    environment_ = {"ROS_PACKAGE_PATH=" + sourceFile("test/example_shaker") + ":" +
                    (packages == nullptr ? "" : packages)};
  }
  // timeout: longer than the delays of a busy machine
  void start(const std::map<std::string, std::string>& shaker, double timeout = 3.0) {
    ros::param::set("/exciter_output/timeout", timeout);
    ros::param::set("/exciter_output/max_amplitude", 10.0);
    for (const auto& [key, value] : shaker) {
      const std::string name = "/exciter_output/shaker/" + key;
      char* end = nullptr;
      const double number = std::strtod(value.c_str(), &end);
      if (*end == '\0') {
        ros::param::set(name, number);
      } else {
        ros::param::set(name, value);
      }
    }
    node_ = std::make_unique<Child>(std::vector<std::string>{executable("exciter_output")},
                                    environment_);
  }
  void startAudio() {
    start({{"type", "audio"},
           {"device", "file:'" + path_ + "',raw"},
           {"gain_x", "0.05"},
           {"gain_y", "0.05"}});
    ASSERT_TRUE(waitFor([this] {
      return done_.last() && exciter_.getNumSubscribers() > 0 && pose_.getNumSubscribers() > 0;
    })) << node_->output();
  }
  void shake(double amplitude, double frequency, const ros::Time& stamp = ros::Time::now()) {
    Exciter exciter;
    exciter.header.stamp = stamp;
    exciter.on = true;
    exciter.amplitude = amplitude;
    exciter.frequency = frequency;
    exciter.direction = 1;
    exciter_.publish(exciter);
  }
  bool on() const { return done_.last() && done_.last()->on; }
  // along x and y, as a sound card would receive it
  std::vector<std::int16_t> played() const {
    std::ifstream in(path_, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    std::vector<std::int16_t> samples(bytes.size() / 4 * 2);
    std::copy_n(bytes.begin(), 2 * samples.size(), reinterpret_cast<char*>(samples.data()));
    return samples;
  }
  bool warned(const std::string& text, double patience = test::kPatience) {
    return waitFor([&] { return node_->running() && !node_->lines(text).empty(); }, patience);
  }

  ros::NodeHandle nh_;
  const std::string path_;
  Record<Exciter> done_;
  Record<std_msgs::Float64> speed_;
  Record<diagnostic_msgs::DiagnosticArray> diagnostics_;
  ros::Publisher exciter_, pose_;
  std::atomic<bool> alive_{true}, quit_{false};
  std::thread beat_;
  std::vector<std::string> environment_;
  std::unique_ptr<Child> node_;
};

TEST_F(ExciterOutput, PlaysWhatTheBridgeLetsPassAndIsSilentWithoutIt) {
  // sent long before the node was started, and latched
  shake(5.0, 600.0, ros::Time::now() - ros::Duration(30.0));
  startAudio();
  ASSERT_TRUE(warned("stale")) << node_->output();
  EXPECT_FALSE(on());

  const double w = 2 * M_PI * 120.0;
  const auto started = [&] {  // after the first carrier_pose
    shake(5.0, w);
    return waitFor([this] { return on(); }, 1.0);
  };
  ASSERT_TRUE(waitFor(started)) << node_->output();
  EXPECT_EQ(done_.last()->amplitude, 5.0);
  EXPECT_EQ(done_.last()->frequency, w);
  const auto size = [this] {
    return static_cast<std::int64_t>(std::ifstream(path_, std::ios::ate).tellg());
  };
  const std::int64_t before = size();
  ASSERT_TRUE(waitFor([&] { return size() > before + 4 * 24000; }));
  // too large an amplitude is refused, the previous command continues
  const auto too_much = [&] {
    shake(50.0, w);
    return warned("max_amplitude", 1.1);
  };
  ASSERT_TRUE(waitFor(too_much)) << node_->output();
  EXPECT_TRUE(on());

  // the bridge dies
  alive_ = false;
  ASSERT_TRUE(waitFor([this] { return !on(); })) << node_->output();
  EXPECT_TRUE(warned("exciter off: no carrier_pose")) << node_->output();
  const auto refused = [&] {  // a warning a second
    shake(5.0, w);
    return warned("without a bridge", 1.1);
  };
  ASSERT_TRUE(waitFor(refused)) << node_->output();
  // and is restarted: the previous command doesn't start by itself
  alive_ = true;
  const std::int64_t then = size();
  ASSERT_TRUE(waitFor([&] { return size() > then + 4 * 9600; }));
  EXPECT_FALSE(on());
  node_->stop();

  const std::vector<std::int16_t> samples = played();
  const auto first = std::find_if(samples.begin(), samples.end(), [](auto s) { return s != 0; });
  ASSERT_NE(first, samples.end());
  // a tenth of a second after it began: a circle of a quarter of full scale, 120 times a second
  const auto from = static_cast<std::size_t>(first - samples.begin()) / 2 + 4800;
  ASSERT_GT(samples.size() / 2, from + 9600);
  std::vector<double> turns;
  for (std::size_t i = from; i < from + 9600; ++i) {
    const double x = samples[2 * i], y = samples[2 * i + 1];
    ASSERT_NEAR(std::hypot(x, y), 0.25 * 32767.0, 2.0) << i;
    turns.push_back(std::remainder(
        std::atan2(samples[2 * i + 3], samples[2 * i + 2]) - std::atan2(y, x), 2 * M_PI));
  }
  // a busy machine leaves gaps, at which the phase jumps; 0.1 % is the error of a card's clock
  std::nth_element(turns.begin(), turns.begin() + 4800, turns.end());
  EXPECT_NEAR(turns[4800], w / 48000.0, 2e-3 * w / 48000.0);
  for (std::size_t i = samples.size() - 9600; i < samples.size(); ++i) ASSERT_EQ(samples[i], 0);
}

TEST_F(ExciterOutput, MotorRunsUpIsMeasuredAndRunsDown) {
  start({{"type", "unbalance"},
         {"unbalance", "1e-4"},
         {"acceleration", "1000"},
         {"max_speed", "400"}});
  ASSERT_TRUE(waitFor([this] {
    return speed_.last() && exciter_.getNumSubscribers() > 0 && pose_.getNumSubscribers() > 0;
  })) << node_->output();
  const auto running = [this] {
    shake(9.0, 300.0);
    return waitFor([this] { return speed_.last()->data == 300.0; }, 2.0);
  };
  ASSERT_TRUE(waitFor(running)) << node_->output();
  ros::Publisher index = nh_.advertise<std_msgs::Header>("arm/exciter_index", 10);
  ASSERT_TRUE(waitFor([&] { return index.getNumSubscribers() > 0; }));
  // pulses as of 5 revolutions a second: longer than the gaps of a busy machine
  const auto measured = [&] {
    std_msgs::Header pulse;
    pulse.stamp = ros::Time::now();
    index.publish(pulse);
    pulse.stamp += ros::Duration(0.2);
    index.publish(pulse);
    return done_.last() && std::abs(done_.last()->frequency - 2 * M_PI / 0.2) < 1e-3;
  };
  EXPECT_TRUE(waitFor(measured)) << node_->output();
  Exciter off;
  off.header.stamp = ros::Time::now();
  off.direction = 1;
  exciter_.publish(off);
  EXPECT_TRUE(waitFor([this] { return speed_.last()->data == 0.0 && !on(); })) << node_->output();
}

// A class in another library, found by its name, with its own keys and its own refusals.
TEST_F(ExciterOutput, LoadsAPlugInFromAnotherPackage) {
  withExample();
  start({{"type", "assembly_cell_example_shaker/Ideal"}, {"largest", "8"}});
  ASSERT_TRUE(waitFor([this] {
    return done_.last() && exciter_.getNumSubscribers() > 0 && pose_.getNumSubscribers() > 0;
  })) << node_->output();
  const auto started = [&] {  // after the first carrier_pose
    shake(5.0, 600.0);
    return waitFor([this] { return on(); }, 1.0);
  };
  ASSERT_TRUE(waitFor(started)) << node_->output();
  EXPECT_EQ(done_.last()->amplitude, 5.0);
  const auto refused = [&] {  // a warning a second; the node itself would take 10 N
    shake(9.0, 600.0);
    return warned("give at most 8 (largest)", 1.1);
  };
  ASSERT_TRUE(waitFor(refused)) << node_->output();
  EXPECT_TRUE(on());
  alive_ = false;
  EXPECT_TRUE(waitFor([this] { return !on(); })) << node_->output();
}

TEST_F(ExciterOutput, RefusesABadShakerInOneLine) {
  const auto refusal = [this](const std::map<std::string, std::string>& shaker) {
    ros::param::del("/exciter_output");
    withExample();
    start(shaker);
    EXPECT_EQ(node_->wait(), 1) << node_->output();
    return node_->output();
  };
  EXPECT_NE(refusal({{"type", "theremin"}}).find("give one of audio, unbalance"),
            std::string::npos);
  EXPECT_NE(
      refusal({{"type", "audio"}, {"device", "no_such_card"}, {"gain_x", "1"}, {"gain_y", "1"}})
          .find("no_such_card"),
      std::string::npos);
  EXPECT_NE(refusal({}).find("shaker is no map: give {type: audio, ...}"), std::string::npos);
  // the known types are named, those of other packages too
  EXPECT_NE(refusal({{"type", "assembly_cell_example_shaker/Missing"}})
                .find("assembly_cell_example_shaker/Ideal"),
            std::string::npos);
  EXPECT_NE(
      refusal({{"type", "assembly_cell_example_shaker/Ideal"}, {"larges", "8"}}).find("larges"),
      std::string::npos);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::exciter_output_test
