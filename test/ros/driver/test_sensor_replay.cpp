// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/WrenchSamples.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>
#include <vector>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/sensor/devices/replay.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell::ros_bridge::sensor_replay_test {
namespace {

constexpr double kPatience = 60.0;  // of the wall clock, for a busy machine [s]

template <class Condition>
bool waitFor(const Condition& condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kPatience);
  while (ros::ok() && ros::WallTime::now() < end) {
    if (condition()) return true;
    ros::WallDuration(0.005).sleep();
  }
  return condition();
}

// What one topic said.
template <class M>
class Listener {
 public:
  explicit Listener(const std::string& topic) {
    const boost::function<void(const boost::shared_ptr<const M>&)> callback =
        [this](const boost::shared_ptr<const M>& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          messages_.push_back(*m);
        };
    sub_ = ros::NodeHandle().subscribe<M>(topic, 10000, callback);
  }
  std::vector<M> copy() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }

 private:
  std::mutex mutex_;
  std::vector<M> messages_;
  ros::Subscriber sub_;
};

const Recording& recording() {
  static const Recording r =
      loadRecording(ASSEMBLY_CELL_SOURCE_DIR "/test/data/drift.csv", ReplayFormat());
  return r;
}

// the newest status of that name for which the condition holds
template <class Condition>
diagnostic_msgs::DiagnosticStatus diagnosis(Listener<diagnostic_msgs::DiagnosticArray>& listener,
                                            const std::string& name, const Condition& condition) {
  diagnostic_msgs::DiagnosticStatus found;
  EXPECT_TRUE(waitFor([&] {
    for (const auto& array : listener.copy()) {
      for (const auto& status : array.status) {
        if (status.name == name) found = status;
      }
    }
    return found.name == name && condition(found);
  })) << name
      << ": " << found.message;
  return found;
}

double number(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key) {
  for (const auto& pair : status.values) {
    if (pair.key == key) return std::stod(pair.value);
  }
  return std::nan("");
}

// Every row of the file, in order, on the recording's own time base.
TEST(SensorReplay, FastPlaysEveryRowOfTheFile) {
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  Listener<WrenchSamples> samples("/fast/wrench_samples");
  const Recording& r = recording();
  ASSERT_TRUE(waitFor([&] { return samples.copy().size() >= r.time.size(); }));
  const auto all = samples.copy();
  ASSERT_EQ(all.size(), r.time.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].sequence, i);
    EXPECT_NEAR(all[i].header.stamp.toSec(), r.time[i], 1e-9);  // a stamp counts nanoseconds
    EXPECT_EQ(all[i].header.frame_id, "sensor");
    EXPECT_NEAR(all[i].period, 0.1, 1e-4);
    ASSERT_EQ(all[i].wrench.size(), 6u);
    EXPECT_EQ(Vector6(Vector6::Map(all[i].wrench.data())), r.values[i]);
  }
  const auto status = diagnosis(diagnostics, "fast/driver: samples", [](const auto& s) {
    return s.message == "the recording has ended";
  });
  EXPECT_EQ(status.level, 0);
  EXPECT_EQ(status.hardware_id, "ati-axia80");
  EXPECT_EQ(number(status, "samples"), 300);
  EXPECT_NEAR(number(status, "rate [Hz]"), 10.0, 0.01);
  EXPECT_NEAR(number(status, "noise rms fy [N]"), 0.0376, 0.002);  // of 256 rows or all 300
}

// The real recording reaches `wrench` at its own pace, with rate and noise in the diagnostics.
TEST(SensorReplay, OriginalPlaysToWrenchAtItsOwnPace) {
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  Listener<geometry_msgs::WrenchStamped> wrench("/original/wrench");
  const Recording& r = recording();
  ASSERT_TRUE(waitFor([&] { return wrench.copy().size() >= 30; }));
  const auto all = wrench.copy();
  // find the first one in the file, then follow
  std::size_t row = 0;
  while (row < r.values.size() && fromWrench(all[0].wrench) != r.values[row]) ++row;
  ASSERT_LT(row, r.values.size());
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(fromWrench(all[i].wrench), r.values[(row + i) % r.values.size()]);
    if (i > 0) {
      EXPECT_NEAR((all[i].header.stamp - all[i - 1].header.stamp).toSec(), 0.1, 0.001);
    }
  }
  // stamped with the present: when it arrives at most some seconds old
  EXPECT_NEAR((ros::Time::now() - wrench.copy().back().header.stamp).toSec(), 0.0, 5.0);

  // noise of fy in any 50 rows that follow each other, and 20 % for the rows that a report is late
  double least = 1.0, most = 0.0;
  for (std::size_t start = 0; start + 51 <= r.values.size(); ++start) {
    DifferenceNoise noise;
    for (std::size_t i = start; i < start + 51; ++i) noise.add(r.values[i]);
    least = std::min(least, noise.rms()[1]);
    most = std::max(most, noise.rms()[1]);
  }
  const auto status = diagnosis(diagnostics, "original/driver: samples", [](const auto& s) {
    return number(s, "samples in noise rms") >= 50;
  });
  EXPECT_EQ(status.level, 0) << status.message;
  EXPECT_NEAR(number(status, "rate [Hz]"), 10.0, 0.1);
  EXPECT_NEAR(number(status, "expected rate [Hz]"), 10.0, 0.1);
  EXPECT_GT(number(status, "noise rms fy [N]"), 0.8 * least);
  EXPECT_LT(number(status, "noise rms fy [N]"), 1.2 * most);
}

TEST(SensorReplay, IsZeroedLikeAnySensor) {
  std_srvs::Trigger trigger;
  ASSERT_TRUE(ros::service::waitForService("/original/driver/zero", ros::Duration(kPatience)));
  ASSERT_TRUE(callService("/original/driver/zero", trigger));
  ASSERT_TRUE(trigger.response.success) << trigger.response.message;
  Listener<geometry_msgs::WrenchStamped> wrench("/original/wrench"), raw("/original/wrench_raw"),
      bias("/original/bias");
  ASSERT_TRUE(waitFor(
      [&] { return wrench.copy().size() >= 3 && raw.copy().size() >= 3 && !bias.copy().empty(); }));
  const Vector6 b = fromWrench(bias.copy().back().wrench);
  EXPECT_GT(b.norm(), 1.0);
  int pairs = 0;
  for (const auto& w : wrench.copy()) {
    for (const auto& x : raw.copy()) {
      if (w.header.stamp != x.header.stamp) continue;
      ++pairs;
      EXPECT_EQ(fromWrench(w.wrench), fromWrench(x.wrench) - b);
    }
  }
  EXPECT_GE(pairs, 2);

  // a recording that has ended is a silent source
  ASSERT_TRUE(callService("/fast/driver/zero", trigger));
  EXPECT_FALSE(trigger.response.success);
}

// A recording of wrenches has no strain, and no matrix to change.
TEST(SensorReplay, HasNoStrain) {
  ros::master::V_TopicInfo topics;
  ASSERT_TRUE(ros::master::getTopics(topics));
  for (const auto& topic : topics) EXPECT_NE(topic.name, "/original/strain");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::sensor_replay_test
