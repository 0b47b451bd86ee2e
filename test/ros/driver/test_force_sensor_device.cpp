// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "driver_fixture.h"
#include "emulators.h"

namespace assembly_cell::test::force_sensor_device_test {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kRate = 1000.0;      // of the emulated device [Hz]
constexpr double kLongestWait = 5.0;  // between two attempts [s]

// The number of an emulated sample, after one that is known: the values repeat every 4001.
std::optional<std::uint64_t> sampleNumber(const double* wrench, std::uint64_t from) {
  for (std::uint64_t n = from; n < from + 4001; ++n) {
    if (std::abs(wrench[0] - emulatedValue(n, 0)) < 1e-9) return n;
  }
  return std::nullopt;
}

// Follows every sample of a driver: values, order, stamps and when they came.
class Follower {
 public:
  Follower(ros::NodeHandle& nh, const std::string& group)
      : sub_(nh.subscribe<WrenchSamples>(
            "/" + group + "/wrench_samples", 1000,
            boost::function<void(const WrenchSamples::ConstPtr&)>(
                [this](const WrenchSamples::ConstPtr& block) { onBlock(*block); }),
            ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay())) {}

  struct Seen {
    std::uint64_t samples = 0;
    std::uint64_t wrong = 0;      // not a sample of the device, or out of order
    std::uint64_t unordered = 0;  // stamped before the sample that came before
    double oldest = 0.0;          // age of a block's last sample at its arrival [s]
    double youngest = 1e9;
    ros::Time last;  // stamp of the newest sample
  };
  Seen seen() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return seen_;
  }
  // a device that restarts counts from the start
  void restart() {
    const std::lock_guard<std::mutex> lock(mutex_);
    next_ = 0;
    known_ = false;
  }

 private:
  void onBlock(const WrenchSamples& block) {
    const double now = ros::Time::now().toSec();
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t k = 0; k < block.wrench.size() / 6; ++k) {
      const double* wrench = &block.wrench[6 * k];
      const auto number = sampleNumber(wrench, next_);
      bool right = number.has_value();
      for (std::size_t axis = 0; right && axis < 6; ++axis) {
        right = std::abs(wrench[axis] - emulatedValue(*number, axis)) < 1e-9;
      }
      // values repeat: more than half of that ahead is behind
      if (!right || (known_ && *number > next_ + 2000)) ++seen_.wrong;
      if (number) next_ = *number + 1;
      known_ = true;
      ++seen_.samples;
    }
    if (block.header.stamp <= seen_.last) ++seen_.unordered;
    seen_.last = block.header.stamp +
                 ros::Duration(block.period * static_cast<double>(block.wrench.size() / 6 - 1));
    seen_.oldest = std::max(seen_.oldest, now - seen_.last.toSec());
    seen_.youngest = std::min(seen_.youngest, now - seen_.last.toSec());
  }

  std::mutex mutex_;
  Seen seen_;
  std::uint64_t next_ = 0;
  bool known_ = false;
  ros::Subscriber sub_;
};

class DeviceTest : public ::testing::Test {
 protected:
  DeviceTest() : diagnoses_(nh_) {}

  NetftEmulator::Options boxOptions() const {
    NetftEmulator::Options options;
    options.rate = kRate;
    options.configuration.rate = kRate;
    return options;
  }
  std::vector<std::string> parametersOf(const NetftEmulator& box) const {
    return {"_source/type:=netft", "_source/address:=127.0.0.1",
            "_source/port:=" + std::to_string(box.port()),
            "_source/http_port:=" + std::to_string(box.httpPort())};
  }
  std_srvs::Trigger::Response trigger(const std::string& service) {
    std_srvs::Trigger call;
    EXPECT_TRUE(ros::service::waitForService(service, ros::Duration(kPatience)));
    EXPECT_TRUE(ros_bridge::callService(service, call)) << service;
    return call.response;
  }

  ros::NodeHandle nh_;
  Diagnoses diagnoses_;
};

// Each sample of the box comes out as it was measured, and the diagnostics tell who it is.
TEST_F(DeviceTest, DeliversWhatTheBoxMeasures) {
  NetftEmulator box(boxOptions());
  Follower follower(nh_, "clean");
  Driver driver("clean", parametersOf(box));
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 2000; })) << driver.output();
  const auto seen = follower.seen();
  EXPECT_EQ(seen.wrong, 0u);
  EXPECT_EQ(seen.unordered, 0u);
  // never stamped later than it arrived (the clocks are one), 1 ms for rounding and the filter
  EXPECT_GT(seen.youngest, -1e-3);

  ASSERT_TRUE(diagnoses_.await("clean/driver: device", [](const auto& s) { return s.level == 0; }))
      << diagnoses_.latest("clean/driver: device").message;
  const auto status = diagnoses_.latest("clean/driver: device");
  EXPECT_EQ(status.message, "connected to 127.0.0.1:" + std::to_string(box.port()));
  EXPECT_EQ(value(status, "device serial number"), "EMU-1");
  EXPECT_EQ(value(status, "quantity"), "wrench");
  EXPECT_EQ(status.hardware_id, "EMU-1");
  EXPECT_EQ(number(status, "reconnects"), 0);
  EXPECT_EQ(number(status, "CRC errors"), 0);
  EXPECT_EQ(number(status, "dropped samples"), 0);
  EXPECT_GT(number(status, "delay p99 [ms]"), 0.0);
  // the box's own rate is the expected one
  ASSERT_TRUE(diagnoses_.await("clean/driver: samples", [](const auto& s) {
    return std::abs(number(s, "rate [Hz]") - kRate) < 0.05 * kRate;
  }));
  EXPECT_EQ(number(diagnoses_.latest("clean/driver: samples"), "expected rate [Hz]"), kRate);
  GetCalibration calibration;
  ASSERT_TRUE(ros_bridge::callService("/clean/driver/get_calibration", calibration));
  EXPECT_EQ(calibration.response.calibration.id, "in the device");
  EXPECT_EQ(calibration.response.calibration.serial_number, "EMU-1");
}

// Datagrams that the kernel dropped because the driver didn't read in time: on a busy machine.
double droppedByKernel(int port) {
  std::ifstream sockets("/proc/net/udp");
  std::string line;
  std::getline(sockets, line);
  double dropped = 0.0;
  while (std::getline(sockets, line)) {
    std::istringstream words(line);
    std::string word, remote;
    words >> word >> word >> remote;
    while (words >> word) {
    }
    if (std::stoi(remote.substr(remote.find(':') + 1), nullptr, 16) == port) {
      dropped += std::stod(word);
    }
  }
  return dropped;
}

// What the link loses is counted to the last sample, and none comes out wrong.
TEST_F(DeviceTest, CountsLossesExactly) {
  NetftEmulator box(boxOptions());
  Follower follower(nh_, "lossy");
  Driver driver("lossy", parametersOf(box));
  // a record that's lost before the first one was never asked for
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 0; })) << driver.output();
  box.setFaults({0.1, 0.05, 0.05});
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 3000; })) << driver.output();
  box.setFaults({});
  const std::string name = "lossy/driver: device";
  // all that was under way when the faults ended has been settled
  ASSERT_TRUE(diagnoses_.await(
      name, [](const auto& s) { return s.level == 0; }, true))
      << diagnoses_.latest(name).message;
  const auto status = diagnoses_.latest(name);
  EXPECT_EQ(number(status, "lost samples"),
            static_cast<double>(box.lost()) + droppedByKernel(box.port()));
  EXPECT_EQ(number(status, "reconnects"), 0);
  EXPECT_GT(box.lost(), 100u);
  EXPECT_GT(number(status, "duplicate samples"), 50);
  EXPECT_GT(number(status, "reordered samples"), 50);
  EXPECT_EQ(follower.seen().wrong, 0u);
  EXPECT_EQ(follower.seen().unordered, 0u);
}

// Unplugged and returned at random: distinguished from a wrong address, back within its back-off,
// and nothing old is ever stamped as new.
TEST_F(DeviceTest, ComesBackAfterUnplugging) {
  NetftEmulator box(boxOptions());
  Follower follower(nh_, "unplugged");
  Driver driver("unplugged", parametersOf(box));
  const std::string name = "unplugged/driver: device";
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 100; })) << driver.output();
  int unplugs = 3;
  ros::param::get("~unplugs", unplugs);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> out(0.3, 4.0), in(0.1, 1.0);
  double slowest = 0.0;
  for (int i = 0; i < unplugs; ++i) {
    box.setDead(true);
    const ros::WallTime gone = ros::WallTime::now();
    if (i == 0) {
      // seen as gone, as a dynamic cause
      ASSERT_TRUE(diagnoses_.await(
          name, [](const auto& s) { return s.level == DiagnosticStatus::ERROR; }, true));
      const auto status = diagnoses_.latest(name);
      EXPECT_FALSE(value(status, "dynamic cause").empty());
      EXPECT_EQ(value(status, "static cause"), "");
      EXPECT_FALSE(has(status.message, "not once since the start")) << status.message;
      // a zero is refused at once instead of hanging
      EXPECT_FALSE(trigger("/unplugged/driver/zero").success);
    }
    const ros::WallDuration left(ros::WallDuration(out(random)) - (ros::WallTime::now() - gone));
    if (left.toSec() > 0.0) left.sleep();

    const auto before = follower.seen();
    const ros::Time back = ros::Time::now();
    const ros::WallTime start = ros::WallTime::now();
    box.restart();
    follower.restart();
    box.setDead(false);
    ASSERT_TRUE(waitFor([&] { return follower.seen().samples > before.samples; }))
        << "unplug " << i << ": " << diagnoses_.latest(name).message;
    slowest = std::max(slowest, (ros::WallTime::now() - start).toSec());
    // measured after the return, not before
    EXPECT_GT(follower.seen().last, back);
    ros::WallDuration(in(random)).sleep();
  }
  // the last attempt began at most a back-off earlier; it waits for HTTP and a start
  EXPECT_LT(slowest, kLongestWait + 3.0);
  const auto seen = follower.seen();
  EXPECT_EQ(seen.wrong, 0u);
  EXPECT_EQ(seen.unordered, 0u);
  EXPECT_GT(seen.youngest, -1e-3);
  ASSERT_TRUE(diagnoses_.await(
      name, [](const auto& s) { return s.level == DiagnosticStatus::OK; }, true));
  EXPECT_GE(number(diagnoses_.latest(name), "reconnects"), 1);
  EXPECT_LE(number(diagnoses_.latest(name), "reconnects"), unplugs);
  EXPECT_FALSE(value(diagnoses_.latest(name), "last loss").empty());
  RecordProperty("slowest_return_ms", static_cast<int>(1e3 * slowest));
  std::printf("%d unplugs, slowest return %.2f s, oldest sample at its arrival %.1f ms\n", unplugs,
              slowest, 1e3 * seen.oldest);
}

// A device that was never there is reported as such, and is opened when it appears.
TEST_F(DeviceTest, WaitsForADeviceThatIsNotThereYet) {
  auto box = std::make_unique<NetftEmulator>(boxOptions());
  const std::vector<std::string> parameters = parametersOf(*box);
  NetftEmulator::Options again = boxOptions();
  again.port = box->port();
  again.http_port = box->httpPort();
  box.reset();
  Driver driver("absent", parameters);
  const std::string name = "absent/driver: device";
  ASSERT_TRUE(diagnoses_.await(name, [](const auto& s) {
    return s.level == DiagnosticStatus::ERROR && has(s.message, "not once since the start");
  })) << driver.output();
  EXPECT_EQ(value(diagnoses_.latest(name), "static cause"), "");
  Follower follower(nh_, "absent");
  box = std::make_unique<NetftEmulator>(again);
  EXPECT_TRUE(waitFor([&] { return follower.seen().samples > 10; }));
  EXPECT_EQ(number(diagnoses_.latest(name), "reconnects"), 0);
}

// Volts without a calibration can't work, whatever the cable does: a static cause.
TEST_F(DeviceTest, ReportsWhatTheConfigurationLacks) {
  NetftEmulator::Options options = boxOptions();
  options.configuration.force_unit = options.configuration.torque_unit = "V";
  NetftEmulator box(options);
  Driver driver("volts", parametersOf(box));
  const std::string name = "volts/driver: device";
  ASSERT_TRUE(diagnoses_.await(name, [](const auto& s) {
    return s.level == DiagnosticStatus::ERROR && has(s.message, "set calibration_file");
  })) << driver.output();
  EXPECT_TRUE(has(value(diagnoses_.latest(name), "static cause"), "volts"));
  EXPECT_EQ(value(diagnoses_.latest(name), "state"), "misconfigured");

  // with one it is a strain sensor like any other; the calibration of another sensor shows
  std::vector<std::string> parameters = parametersOf(box);
  parameters.push_back("_calibration_file:=" + sourceFile("config/calibration/sensor_a.yaml"));
  Driver calibrated("strain", parameters);
  Record<StrainSamples> strain(nh_, "/strain/strain");
  ASSERT_TRUE(waitFor([&] { return strain.size() > 3; })) << calibrated.output();
  ASSERT_TRUE(diagnoses_.await("strain/driver: device", [](const auto& s) {
    return has(s.message, "the calibration is of 'simulated-a'");
  }));
  EXPECT_EQ(diagnoses_.latest("strain/driver: device").level, DiagnosticStatus::ERROR);
}

// The device's fault word stops the samples and is reported; healthy again, they go on.
TEST_F(DeviceTest, PublishesNothingOfAFaultyDevice) {
  NetftEmulator box(boxOptions());
  Follower follower(nh_, "faulty");
  Driver driver("faulty", parametersOf(box));
  const std::string name = "faulty/driver: device";
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 100; })) << driver.output();
  box.setStatus(0x80020000u);
  ASSERT_TRUE(diagnoses_.await(name, [](const auto& s) {
    return s.level == DiagnosticStatus::ERROR && value(s, "fault word") == "0x80020000";
  }));
  const std::string fault = "reports: transducer saturated or A/D converter fails, 0x80020000";
  EXPECT_TRUE(has(diagnoses_.latest(name).message, "the device " + fault))
      << diagnoses_.latest(name).message;
  EXPECT_TRUE(waitFor([&] { return driver.running() && has(driver.output(), fault); }))
      << driver.output();
  const auto at_fault = follower.seen();
  ASSERT_TRUE(diagnoses_.await(
      name, [&](const auto& s) { return number(s, "faulty samples") > 500; }, true));
  EXPECT_EQ(follower.seen().samples, at_fault.samples);
  box.setStatus(0);
  EXPECT_TRUE(diagnoses_.await(
      name, [](const auto& s) { return s.level == DiagnosticStatus::OK; }, true));
  EXPECT_GT(follower.seen().samples, at_fault.samples);
  EXPECT_EQ(follower.seen().wrong, 0u);
}

// Old counts under new numbers: warned of, then an error; nothing is published that would let a
// machine go on, and nothing is zeroed by it.
TEST_F(DeviceTest, HoldsFrozenReadings) {
  NetftEmulator box(boxOptions());
  Follower follower(nh_, "frozen");
  std::vector<std::string> parameters = parametersOf(box);
  // room for a report between the warning and the error
  parameters.push_back("_frozen_after:=2.0");
  Driver driver("frozen", parameters);
  const std::string name = "frozen/driver: samples";
  ASSERT_TRUE(waitFor([&] { return follower.seen().samples > 100; })) << driver.output();
  ASSERT_TRUE(diagnoses_.await(
      name, [](const auto& s) { return s.level == DiagnosticStatus::OK; }, true));
  box.setFrozen(true);
  const std::string words = "frozen readings: all six channels have had exactly the same reading";
  EXPECT_TRUE(diagnoses_.await(name, [&](const auto& s) {
    return s.level == DiagnosticStatus::WARN && has(s.message, words);
  })) << diagnoses_.latest(name).message;
  ASSERT_TRUE(diagnoses_.await(name, [&](const auto& s) {
    return s.level == DiagnosticStatus::ERROR && has(s.message, words);
  })) << diagnoses_.latest(name).message;
  EXPECT_TRUE(has(diagnoses_.latest(name).message, "set frozen_after: 0"));
  const auto held = follower.seen();
  const auto zero = trigger("/frozen/driver/zero");
  EXPECT_FALSE(zero.success);
  EXPECT_TRUE(has(zero.message, "the device or its link is frozen")) << zero.message;
  EXPECT_EQ(follower.seen().samples, held.samples);
  EXPECT_TRUE(waitFor([&] { return driver.running() && has(driver.output(), words); }))
      << driver.output();
  box.setFrozen(false);
  EXPECT_TRUE(waitFor([&] { return follower.seen().samples > held.samples; }));
  EXPECT_TRUE(diagnoses_.await(
      name, [](const auto& s) { return s.level == DiagnosticStatus::OK; }, true));
  EXPECT_TRUE(trigger("/frozen/driver/zero").success);
}

// A device without power in its gauges; and one whose noise is below a step, where it is normal.
TEST_F(DeviceTest, ZerosAreFrozenUnlessItsNoiseIsBelowAStep) {
  NetftEmulator::Options options = boxOptions();
  options.amplitude = 0.0;
  NetftEmulator box(options);
  {
    Record<WrenchSamples> samples(nh_, "/zeros/wrench_samples");
    Driver driver("zeros", parametersOf(box));
    ASSERT_TRUE(waitFor([&] { return samples.size() > 0; })) << driver.output();
    // the zero outlasts its own samples: it can't yet be seen whether they are frozen
    const auto zero = trigger("/zeros/driver/zero");
    EXPECT_FALSE(zero.success);
    EXPECT_TRUE(has(zero.message, "all six channels have read exactly zero")) << zero.message;
  }
  std::vector<std::string> parameters = parametersOf(box);
  parameters.push_back("_frozen_after:=0");
  Driver driver("steps", parameters);
  ASSERT_TRUE(diagnoses_.await("steps/driver: samples", [](const auto& s) {
    return s.level == DiagnosticStatus::OK && number(s, "samples") > 2 * kRate;
  })) << driver.output();
  EXPECT_TRUE(trigger("/steps/driver/zero").success);
}

// Each takes the stream from the other one.
TEST_F(DeviceTest, NamesAnotherClientOfItsBox) {
  NetftEmulator box(boxOptions());
  Driver one("one", parametersOf(box)), other("other", parametersOf(box));
  for (const std::string name : {"one/driver: device", "other/driver: device"}) {
    ASSERT_TRUE(diagnoses_.await(name, [](const auto& s) {
      return s.level == DiagnosticStatus::ERROR &&
             has(s.message, "another driver or program that reads the same device");
    })) << diagnoses_.latest(name).message;
  }
  EXPECT_TRUE(waitFor([&] { return one.running() && has(one.output(), "end one of them"); }))
      << one.output();
}

// Who changes counts on the page while it streams makes all that follows wrong by their ratio.
TEST_F(DeviceTest, ReadsItsConfigurationAgain) {
  NetftEmulator::Options options = boxOptions();
  options.load = {0.0, 0.0, 1000.0, 0.0, 0.0, 0.0};
  NetftEmulator box(options);
  Record<WrenchSamples> samples(nh_, "/page/wrench_samples");
  std::vector<std::string> parameters = parametersOf(box);
  parameters.push_back("_source/configuration_period:=0.1");
  Driver driver("page", parameters);
  ASSERT_TRUE(waitFor([&] { return samples.size() > 3; })) << driver.output();
  EXPECT_NEAR(samples.last()->wrench[2], 1000.0, 20.0);
  options.configuration.counts_per_force = 1000.0;
  box.setConfiguration(options.configuration);
  const std::string name = "page/driver: device";
  ASSERT_TRUE(diagnoses_.await(name, [](const auto& s) {
    return has(value(s, "last loss"), "counts per force (cfgcpf) from 1000000 to 1000;");
  })) << driver.output();
  EXPECT_TRUE(waitFor([&] { return std::abs(samples.last()->wrench[2] - 1000.0) < 20.0; }));
  EXPECT_TRUE(has(value(diagnoses_.latest(name), "note"), "1000"));
}

// Wrenches of a device go through the node's bias like any others, and the device's own bias is
// asked for on request alone. The emulated wrench varies: neither can be exact, both must say so.
TEST_F(DeviceTest, BiasOfTheNodeAndOfTheDevice) {
  NetftEmulator box(boxOptions());
  Driver driver("biased", parametersOf(box));
  Record<WrenchSamples> samples(nh_, "/biased/wrench_samples");
  ASSERT_TRUE(waitFor([&] { return samples.size() > 3; })) << driver.output();
  EXPECT_EQ(box.biases(), 0);
  const auto zero = trigger("/biased/driver/zero");
  EXPECT_TRUE(zero.success) << zero.message;
  EXPECT_EQ(box.biases(), 0);
  const auto device = trigger("/biased/driver/device_bias");
  EXPECT_TRUE(has(device.message, "residual of 100 samples")) << device.message;
  EXPECT_GE(box.biases(), 1);
  EXPECT_TRUE(diagnoses_.await("biased/driver: device", [](const auto& s) {
    return value(s, "device bias") == "verified" || value(s, "device bias") == "failed";
  }));
}

}  // namespace
}  // namespace assembly_cell::test::force_sensor_device_test
