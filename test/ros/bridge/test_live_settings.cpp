// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <dynamic_reconfigure/ConfigDescription.h>
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "cell_fixture.h"
#include "live_client.h"

namespace assembly_cell::ros_bridge::live_settings_test {
namespace {

using dynamic_reconfigure::Config;
using test::add;
using test::Child;
using test::setLive;
using test::valueIn;
using test::waitFor;

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();
const std::set<std::string> kRestart{"scenario", "lockstep"};

LiveValues some() {
  return {liveNumber("window", 0.2, {1e-3, 10.0}, "[s]"), liveSwitch("words", true, "shown"),
          liveLimit("force_limit", 40.0, 2.0, "[N]")};
}

// ---- a request ----

template <class Value>
LiveChange changed(const std::string& name, Value value) {
  Config request;
  add(request, name, value);
  return applied(some(), request, "/node/", kRestart);
}

TEST(LiveChange, AcceptsValuesInTheirRange) {
  Config request;
  add(request, "window", 0.5);
  add(request, "words", false);
  const LiveChange change = applied(some(), request, "/node/", kRestart);
  EXPECT_EQ(change.refusal, "");
  EXPECT_EQ(change.cut, "");
  EXPECT_EQ(valueOf(change.values, "window"), 0.5);
  EXPECT_EQ(valueOf(change.values, "words"), 0.0);
  EXPECT_EQ(valueOf(change.values, "force_limit"), 40.0);
  // a whole number is a number
  Config whole;
  whole.ints.emplace_back();
  whole.ints.back().name = "window";
  whole.ints.back().value = 3;
  EXPECT_EQ(valueOf(applied(some(), whole, "/node/", kRestart).values, "window"), 3.0);
}

void expectRefused(const LiveChange& change, const std::string& line) {
  EXPECT_EQ(change.refusal, line);
  EXPECT_EQ(change.cut, "");
  EXPECT_EQ(valueOf(change.values, "window"), 0.2);
  EXPECT_EQ(valueOf(change.values, "words"), 1.0);
  EXPECT_EQ(valueOf(change.values, "force_limit"), 40.0);
}

TEST(LiveChange, RefusalHasNameValueAndBound) {
  const std::string range = "give a number from 0.001 to 10";
  expectRefused(changed("window", kNaN), "parameter /node/window is nan: " + range);
  expectRefused(changed("window", kInfinity), "parameter /node/window is inf: " + range);
  expectRefused(changed("window", 10.5), "parameter /node/window is 10.5: " + range);
  expectRefused(changed("window", 0.0), "parameter /node/window is 0: " + range);
  expectRefused(changed("window", true), "parameter /node/window is no number: give one");
  expectRefused(changed("words", 1.0), "parameter /node/words is a switch: give true or false");
  expectRefused(changed("wimdow", 1.0),
                "parameter /node/wimdow is unknown: live are window, words, force_limit");
  expectRefused(changed("scenario", 1.0),
                "parameter /node/scenario needs a restart: set it before the node starts; live "
                "are window, words, force_limit");
  expectRefused(changed("a\nb\x1b", 1.0),
                "parameter /node/a b  is unknown: live are window, words, force_limit");
}

TEST(LiveChange, LimitsCanOnlyBeLowered) {
  const LiveChange lower = changed("force_limit", 25.0);
  EXPECT_EQ(lower.refusal + lower.cut, "");
  // up again to the value at the start
  Config request;
  add(request, "force_limit", 60.0);
  const LiveChange higher = applied(lower.values, request, "/node/", kRestart);
  EXPECT_EQ(higher.refusal, "");
  EXPECT_EQ(higher.cut,
            "parameter /node/force_limit is 60: more than 40, the value at the start, needs a "
            "restart; 40 is set");
  EXPECT_EQ(valueOf(higher.values, "force_limit"), 40.0);
  const std::string range = "give a number from 2 to 40";
  expectRefused(changed("force_limit", 1.0), "parameter /node/force_limit is 1: " + range);
  expectRefused(changed("force_limit", kNaN), "parameter /node/force_limit is nan: " + range);
  expectRefused(changed("force_limit", kInfinity), "parameter /node/force_limit is inf: " + range);
}

TEST(LiveChange, AcceptsAllOrNothing) {
  Config request;
  add(request, "force_limit", 20.0);
  add(request, "words", false);
  add(request, "window", kNaN);
  expectRefused(applied(some(), request, "/node/", kRestart),
                "parameter /node/window is nan: give a number from 0.001 to 10");
  Config twice;
  add(twice, "window", 1.0);
  add(twice, "window", 2.0);
  expectRefused(applied(some(), twice, "/node/", kRestart),
                "parameter /node/window is given twice: give it once");
  Config text;
  text.strs.emplace_back();
  text.strs.back().name = "window";
  text.strs.back().value = "0.5";
  expectRefused(applied(some(), text, "/node/", kRestart),
                "parameter /node/window is no number: give one");
  Config many;
  for (int i = 0; i < 201; ++i) add(many, "window", 1.0);
  expectRefused(applied(some(), many, "/node/", kRestart), "201 values: give 200 at most");
}

// ---- with a master ----

class Live : public ::testing::Test {
 protected:
  Live() {
    live_ = std::make_unique<LiveSettings>(
        ros::NodeHandle("/live"), some(), kRestart, [](const LiveValues& values) {
          if (valueOf(values, "window") > 5.0 && valueOf(values, "force_limit") < 10.0) {
            throw InputError("window and force_limit don't go together");
          }
        });
  }
  // as on a command line
  static std::string answerOf(const std::vector<std::string>& command) {
    Child child(command);
    child.wait();
    return child.output();
  }
  static std::string call(const std::string& doubles) {
    return answerOf(
        {"rosservice", "call", "/live/set_parameters", "{config: {doubles: [" + doubles + "]}}"});
  }

  std::unique_ptr<LiveSettings> live_;
};

TEST_F(Live, DescribesItsSettings) {
  ros::NodeHandle nh;
  test::Record<dynamic_reconfigure::ConfigDescription> descriptions(nh,
                                                                    "/live/parameter_descriptions");
  test::Record<Config> updates(nh, "/live/parameter_updates");
  ASSERT_TRUE(waitFor([&] { return descriptions.last() && updates.last(); }));
  const auto description = descriptions.last();
  ASSERT_EQ(description->groups.size(), 1U);
  ASSERT_EQ(description->groups[0].parameters.size(), 3U);
  EXPECT_EQ(description->groups[0].parameters[1].type, "bool");
  EXPECT_EQ(description->groups[0].parameters[2].description, "[N]");
  EXPECT_EQ(valueIn(description->max, "force_limit"), 40.0);
  EXPECT_EQ(valueIn(description->min, "window"), 1e-3);
  EXPECT_EQ(valueIn(*updates.last(), "window"), 0.2);

  Config after;
  EXPECT_TRUE(setLive("/live", "window", 0.7, &after));
  EXPECT_EQ(valueIn(after, "window"), 0.7);
  EXPECT_EQ(live_->number("window"), 0.7);
  ASSERT_TRUE(waitFor([&] { return valueIn(*updates.last(), "window") == 0.7; }));
  // a restarted node keeps it
  double kept = 0.0;
  EXPECT_TRUE(nh.getParam("/live/window", kept));
  EXPECT_EQ(kept, 0.7);
}

TEST_F(Live, ARefusalHasAReasonAndChangesNothing) {
  const std::uint64_t refused = IncomingLog::ofThisProcess().figures().refused;
  EXPECT_NE(call("{name: window, value: .nan}")
                .find("parameter /live/window is nan: give a number from 0.001 to 10"),
            std::string::npos);
  EXPECT_NE(call("{name: lockstep, value: 1.0}").find("parameter /live/lockstep needs a restart"),
            std::string::npos);
  EXPECT_NE(call("{name: window, value: 6.0}, {name: force_limit, value: 5.0}")
                .find("parameters /live: window and force_limit don't go together"),
            std::string::npos);
  EXPECT_EQ(IncomingLog::ofThisProcess().figures().refused, refused + 3);
  EXPECT_EQ(live_->number("window"), 0.2);
  EXPECT_EQ(live_->number("force_limit"), 40.0);
  // cut, reported, and answered with the active values
  EXPECT_NE(call("{name: force_limit, value: 60.0}").find("value: 40.0"), std::string::npos);
  EXPECT_NE(IncomingLog::ofThisProcess().figures().last.find("more than 40"), std::string::npos);
}

TEST_F(Live, DynparamGetsAndSets) {
  const std::vector<std::string> dynparam{"rosrun", "dynamic_reconfigure", "dynparam"};
  const auto with = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), dynparam.begin(), dynparam.end());
    return arguments;
  };
  EXPECT_NE(answerOf(with({"list"})).find("/live"), std::string::npos);
  Child set(with({"set", "/live", "{window: 0.25, words: false}"}));
  EXPECT_EQ(set.wait(), 0) << set.output();
  EXPECT_EQ(live_->number("window"), 0.25);
  EXPECT_EQ(live_->number("words"), 0.0);
  EXPECT_NE(answerOf(with({"get", "/live"})).find("'window': 0.25"), std::string::npos);
  Child refused(with({"set", "/live", "window", "11"}));
  EXPECT_NE(refused.wait(), 0) << refused.output();
  EXPECT_EQ(live_->number("window"), 0.25);
}

// Known and unknown names with any value, from two callers at once: every call is answered, and the
// active values stay within their bounds.
TEST_F(Live, AFloodIsAnswered) {
  const auto flood = [](unsigned seed, int& answered) {
    std::mt19937_64 random(seed);
    const std::vector<std::string> names{"window", "words", "force_limit", "scenario",
                                         "",       "%s%n",  "\n",          std::string(20000, 'x')};
    const std::vector<double> values{kNaN, kInfinity, -1e300, 0.0, 0.5, 5.0, 20.0, 1e300, 5e-324};
    const auto any = [&](const auto& list) { return list[random() % list.size()]; };
    ros::ServiceClient client =
        ros::NodeHandle().serviceClient<dynamic_reconfigure::Reconfigure>("/live/set_parameters");
    for (int i = 0; i < 500; ++i) {
      dynamic_reconfigure::Reconfigure call;
      for (std::size_t n = random() % 5; n > 0; --n) {
        add(call.request.config, any(names), any(values));
        if (random() % 3 == 0) add(call.request.config, any(names), random() % 2 == 0);
      }
      client.call(call);
      ++answered;
    }
  };
  int first = 0, second = 0;
  std::thread other([&] { flood(2, second); });
  flood(1, first);
  other.join();
  EXPECT_EQ(first + second, 1000);
  Config after;
  EXPECT_TRUE(setLive("/live", "window", 0.3, &after));
  EXPECT_EQ(valueIn(after, "window"), 0.3);
  EXPECT_GE(valueIn(after, "force_limit"), 2.0);
  EXPECT_LE(valueIn(after, "force_limit"), 40.0);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::live_settings_test
