// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_sensor_fixture.h"
#include "live_client.h"

namespace assembly_cell::ros_bridge::force_sensor_driver_test {
namespace {

// +1 N or +0.1 N·m on the part gives + in every topic, − gives −; the other axes stay zero.
TEST_F(ForceSensorDriver, HasTheSixSignsOfTheConvention) {
  for (Sensor* sensor : {&a_, &b_}) {
    for (int axis = 0; axis < 6; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        Vector6 w = Vector6::Zero();
        w[axis] = sign * (axis < 3 ? 1.0 : 0.1);
        const StrainSamples block = sensor->block(w);
        const WrenchSamples samples = sensor->pass(block);
        ASSERT_EQ(samples.wrench.size(), 600u);
        for (std::size_t k = 0; k < 100; ++k) {
          const Vector6 got = Vector6::Map(&samples.wrench[6 * k]);
          ASSERT_LE((got - w).cwiseAbs().maxCoeff(), kRounding) << "axis " << axis;
        }
        const ros::Time last = block.header.stamp + ros::Duration(99 * block.period);
        for (const auto* topic : {&sensor->wrench_, &sensor->wrench_raw_}) {
          const auto shown = sensor->newest(*topic, [&](const geometry_msgs::WrenchStamped& m) {
            return std::abs((m.header.stamp - last).toSec()) < 1e-6;
          });
          EXPECT_LE((fromWrench(shown.wrench) - w).cwiseAbs().maxCoeff(), kRounding);
          EXPECT_EQ(shown.header.frame_id, sensor == &a_ ? "sensor_a" : "sensor_b");
        }
      }
    }
  }
}

TEST_F(ForceSensorDriver, PassesBlocksOnAsTheyAre) {
  StrainSamples block = a_.block(kLoad, 7);
  block.saturated[3] = 0x21;
  const WrenchSamples wrench = a_.pass(block);
  const StrainSamples strain =
      a_.newest(a_.strain_, [&](const StrainSamples& s) { return s.sequence == block.sequence; });
  EXPECT_EQ(strain.volts, block.volts);
  EXPECT_EQ(strain.saturated, block.saturated);
  EXPECT_EQ(strain.header.stamp, block.header.stamp);
  EXPECT_EQ(strain.temperature, 21.5);
  EXPECT_EQ(wrench.header.stamp, block.header.stamp);
  EXPECT_EQ(wrench.header.frame_id, "sensor_a");
  EXPECT_EQ(wrench.period, block.period);
  EXPECT_EQ(wrench.saturated, block.saturated);
}

// Displacement of sensor_b is the map of its file; sensor_a has no such topic.
TEST_F(ForceSensorDriver, PublishesTheDisplacement) {
  const Calibration c =
      loadCalibration(ASSEMBLY_CELL_SOURCE_DIR "/config/calibration/sensor_b.yaml");
  const StrainSamples block = b_.block(kLoad, 3);
  b_.pass(block);
  const DisplacementSamples d = b_.newest(
      b_.displacement_samples_, [&](const auto& m) { return m.sequence == block.sequence; });
  ASSERT_EQ(d.displacement.size(), 18u);
  const Vector6 expected = displacementFromVolts(c, b_.volts(kLoad));
  EXPECT_LE((Vector6::Map(&d.displacement[12]) - expected).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_GT(expected.cwiseAbs().minCoeff(), 1e-6);  // [m], [rad]: every axis is at stake
  EXPECT_EQ(d.header.stamp, block.header.stamp);
  EXPECT_EQ(d.header.frame_id, "sensor_b");
  EXPECT_TRUE(a_.copy(a_.displacement_samples_).empty());
}

// Short blocks are averaged until the display's period is over: 4 ms blocks at 50 Hz, five each.
TEST_F(ForceSensorDriver, DisplaysTheMeanOfWhatItLeavesOut) {
  // start from a display of its own
  a_.pass(a_.block(Vector6::Zero(), 300));
  a_.newest(a_.wrench_, kAnything);
  a_.clear(a_.wrench_);
  for (int i = 1; i <= 10; ++i) a_.pass(a_.block(i * kLoad, 20));
  ASSERT_TRUE(waitFor([&] { return a_.copy(a_.wrench_).size() >= 2; }));
  const auto shown = a_.copy(a_.wrench_);
  ASSERT_EQ(shown.size(), 2u);
  EXPECT_LE((fromWrench(shown[0].wrench) - 3 * kLoad).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_LE((fromWrench(shown[1].wrench) - 8 * kLoad).cwiseAbs().maxCoeff(), kRounding);
}

// From 50 to 10 Hz while it runs: 25 blocks of 4 ms are one mean.
TEST_F(ForceSensorDriver, DisplaysAtTheRateThatIsSetMeanwhile) {
  const std::string node = "sensor_a/driver";
  EXPECT_FALSE(test::setLive(node, "display_rate", kNaN));
  EXPECT_FALSE(test::setLive(node, "display_rate", 0.0));
  EXPECT_FALSE(test::setLive(node, "zero_samples", 100.0));
  ASSERT_TRUE(test::setLive(node, "display_rate", 10.0));
  // start from a display of its own
  a_.pass(a_.block(Vector6::Zero(), 600));
  a_.newest(a_.wrench_, kAnything);
  a_.clear(a_.wrench_);
  for (int i = 1; i <= 50; ++i) a_.pass(a_.block(0.2 * i * kLoad, 20));
  ASSERT_TRUE(waitFor([&] { return a_.copy(a_.wrench_).size() >= 2; }));
  const auto shown = a_.copy(a_.wrench_);
  ASSERT_EQ(shown.size(), 2u);
  EXPECT_LE((fromWrench(shown[0].wrench) - 0.2 * 13 * kLoad).cwiseAbs().maxCoeff(), kRounding);
  ASSERT_TRUE(test::setLive(node, "display_rate", 50.0));
}

TEST_F(ForceSensorDriver, SubtractsTheBias) {
  SetBias::Request request;
  Vector6::Map(request.bias.data()) = 0.5 * kLoad;
  EXPECT_TRUE(a_.call<SetBias>("set_bias", request).success);
  EXPECT_LE((a_.firstOf(a_.pass(a_.block(kLoad))) - 0.5 * kLoad).cwiseAbs().maxCoeff(), kRounding);
  const auto near = [](const geometry_msgs::WrenchStamped& m, const Vector6& w) {
    return (fromWrench(m.wrench) - w).cwiseAbs().maxCoeff() < kRounding;
  };
  a_.newest(a_.wrench_, [&](const auto& m) { return near(m, 0.5 * kLoad); });
  a_.newest(a_.wrench_raw_, [&](const auto& m) { return near(m, kLoad); });
  const auto bias = a_.newest(a_.bias_, [&](const auto& m) { return near(m, 0.5 * kLoad); });
  EXPECT_EQ(bias.header.frame_id, "sensor_a");

  // a latecomer gets it too
  Sensor late("sensor_a");
  late.newest(late.bias_, [&](const auto& m) { return near(m, 0.5 * kLoad); });

  // the square of the latter isn't finite either
  for (const double wrong : {kNaN, 1e300}) {
    request.bias[2] = wrong;
    const SetBias::Response refused = a_.call<SetBias>("set_bias", request);
    EXPECT_FALSE(refused.success);
    EXPECT_EQ(refused.message, "set_bias refused: bias[2] is " +
                                   std::string(wrong > 0.0 ? "1e+300" : "nan") +
                                   " N: give -100000 to 100000");
  }

  EXPECT_TRUE(a_.trigger("clear_bias").success);
  EXPECT_LE((a_.firstOf(a_.pass(a_.block(kLoad))) - kLoad).cwiseAbs().maxCoeff(), kRounding);
}

// A calibration of another sensor makes loads that no node takes in. The block comes all the same:
// a plant in lockstep would wait for who misses it.
TEST_F(ForceSensorDriver, MarksALoadBeyondAllSensorsAsSaturated) {
  SetCalibration::Request request;
  request.calibration = a_.call<GetCalibration>("get_calibration").calibration;
  const auto own = request;
  for (double& entry : request.calibration.volts_to_wrench) entry *= 1e6;
  const auto taken = a_.call<SetCalibration>("set_calibration", request);
  ASSERT_TRUE(taken.success) << taken.message;
  const StrainSamples block = a_.block(kLoad);
  const WrenchSamples wrenches = a_.pass(block);
  ASSERT_EQ(wrenches.saturated.size(), block.saturated.size());
  bool cut = false;
  for (std::size_t k = 0; k < wrenches.saturated.size(); ++k) {
    EXPECT_EQ(wrenches.saturated[k], 0x3f);
    for (std::size_t j = 0; j < 6; ++j) {
      const double most = j < 3 ? 1e5 : 1e4;
      EXPECT_LE(std::abs(wrenches.wrench[6 * k + j]), most);
      cut |= std::abs(wrenches.wrench[6 * k + j]) == most;
    }
  }
  EXPECT_TRUE(cut);
  // nor does it become a bias
  {
    Feeder feeder(a_, kLoad);
    const auto refused = a_.trigger("zero");
    EXPECT_FALSE(refused.success);
    EXPECT_TRUE(has(refused.message, "beyond 1e5 N")) << refused.message;
  }
  SetBias::Request bias;
  bias.bias[4] = 2e4;
  EXPECT_FALSE(a_.call<SetBias>("set_bias", bias).success);
  ASSERT_TRUE(a_.call<SetCalibration>("set_calibration", own).success);
  EXPECT_LE((a_.firstOf(a_.pass(a_.block(kLoad))) - kLoad).cwiseAbs().maxCoeff(), kRounding);
}

// The mean of at least 200 samples taken after the call: an older load doesn't count.
TEST_F(ForceSensorDriver, ZeroAveragesNewSamples) {
  for (int i = 0; i < 5; ++i) a_.pass(a_.block(-10 * kLoad));
  const double sigma = 0.01;
  std_srvs::Trigger::Response response;
  {
    Feeder feeder(a_, kLoad, sigma);
    response = a_.trigger("zero");
  }
  ASSERT_TRUE(response.success) << response.message;
  int n = 0;
  double s = 0.0;
  ASSERT_EQ(std::sscanf(response.message.c_str(), "bias = mean of %d samples", &n), 1);
  EXPECT_GE(n, 200);
  const std::size_t place = response.message.find("sigma of a sample: ");
  ASSERT_NE(place, std::string::npos) << response.message;
  s = std::stod(response.message.substr(place + 19));
  EXPECT_NEAR(s / sigma, 1.0, 0.3);  // 5 % is one sigma of an estimate from 200
  const Vector6 left = a_.firstOf(a_.pass(a_.block(kLoad)));
  EXPECT_LE(left.cwiseAbs().maxCoeff(), 6 * sigma / std::sqrt(200.0));
}

TEST_F(ForceSensorDriver, ZeroIsRefusedWhileAChannelSaturates) {
  std::atomic<bool> done{false};
  auto answer = std::async(std::launch::async, [&] {
    const auto response = a_.trigger("zero");
    done = true;
    return response;
  });
  while (!done) {
    StrainSamples block = a_.block(kLoad, 20);
    block.saturated[11] = 0x12;
    a_.send(block);
    ros::WallDuration(0.005).sleep();
  }
  const auto response = answer.get();
  EXPECT_FALSE(response.success);
  EXPECT_TRUE(has(response.message, "channel 2, 5 saturated")) << response.message;
  EXPECT_LE((a_.firstOf(a_.pass(a_.block(kLoad))) - kLoad).cwiseAbs().maxCoeff(), kRounding);
}

TEST_F(ForceSensorDriver, ZeroOfASilentSourceIsRefusedInTime) {
  const ros::WallTime start = ros::WallTime::now();
  const auto response = a_.trigger("zero");
  EXPECT_FALSE(response.success);
  EXPECT_TRUE(has(response.message, "no samples for 1.5 s")) << response.message;
  EXPECT_LT((ros::WallTime::now() - start).toSec(), kPatience);
}

// While one call of zero waits, data and the other services go on, and a second zero is refused:
// whichever of two comes second.
TEST_F(ForceSensorDriver, ServicesDoNotBlockTheData) {
  const auto zero = [&] { return a_.trigger("zero"); };
  auto one = std::async(std::launch::async, zero), other = std::async(std::launch::async, zero);
  const auto ended = [](const auto& answer) {
    return answer.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  // 1 sample a block: the zero needs 200 of them, and here come 40, or a few more until both calls
  // have arrived on a busy machine
  for (int i = 0; i < 40 || (i < 150 && !ended(one) && !ended(other)); ++i) {
    a_.pass(a_.block(kLoad, 1));
    if (i == 20) {
      EXPECT_TRUE(a_.call<GetCalibration>("get_calibration").success);
    }
    if (i >= 40) ros::WallDuration(0.02).sleep();
  }
  const auto first = one.get(), second = other.get();
  EXPECT_FALSE(first.success);
  EXPECT_FALSE(second.success);
  EXPECT_NE(has(first.message, "another one is under way"),
            has(second.message, "another one is under way"))
      << first.message << "; " << second.message;
}

// Tared to a load that hangs there, the sensor reads that load; undo goes back step by step, with
// the time of the earlier bias; what the sensor read before the bias never changes.
TEST_F(ForceSensorDriver, ZeroToALoadAndUndo) {
  const Vector6 offset = (Vector6() << 0.5, 0.25, -1, 0.01, 0.02, -0.03).finished();
  const auto reads = [&](const Vector6& w) {
    const StrainSamples block = a_.block(kLoad + offset);
    EXPECT_LE((a_.firstOf(a_.pass(block)) - w).cwiseAbs().maxCoeff(), kRounding);
    const auto stamp = block.header.stamp + ros::Duration(99 * block.period);
    const auto raw = a_.newest(a_.wrench_raw_, [&](const auto& m) {
      return std::abs((m.header.stamp - stamp).toSec()) < 1e-6;
    });
    EXPECT_LE((fromWrench(raw.wrench) - kLoad - offset).cwiseAbs().maxCoeff(), kRounding);
    const auto strain =
        a_.newest(a_.strain_, [&](const StrainSamples& s) { return s.sequence == block.sequence; });
    EXPECT_EQ(strain.volts, block.volts);
  };
  const auto bias = [&](const Vector6& b) {
    return a_.newest(a_.bias_, [&](const geometry_msgs::WrenchStamped& m) {
      return (fromWrench(m.wrench) - b).cwiseAbs().maxCoeff() < kRounding;
    });
  };
  ZeroTo::Request request;
  Vector6::Map(request.wrench.data()) = kLoad;
  ZeroTo::Response response;
  {
    Feeder feeder(a_, kLoad + offset);
    response = a_.call<ZeroTo>("zero_to", request);
  }
  ASSERT_TRUE(response.success) << response.message;
  EXPECT_TRUE(has(response.message, "- load (3 -4 12 N, 0.2 -0.1 0.05 N m): 0.5 0.25 -1 N,"))
      << response.message;
  reads(kLoad);
  const ros::Time taken = bias(offset).header.stamp;
  EXPECT_GT(taken.toSec(), 0.0);

  SetBias::Request other;
  other.bias[2] = 7.0;
  EXPECT_TRUE(a_.call<SetBias>("set_bias", other).success);
  EXPECT_TRUE(a_.trigger("clear_bias").success);
  reads(kLoad + offset);
  EXPECT_EQ(bias(Vector6::Zero()).header.stamp, ros::Time());
  EXPECT_TRUE(a_.trigger("undo_bias").success);
  bias(7.0 * Vector6::Unit(2));
  EXPECT_TRUE(a_.trigger("undo_bias").success);
  EXPECT_EQ(bias(offset).header.stamp, taken);
  reads(kLoad);

  // a zero that is refused is no step; a new calibration leaves nothing to undo
  request.wrench[4] = kNaN;
  EXPECT_EQ(a_.call<ZeroTo>("zero_to", request).message,
            "zero_to refused: wrench[4] is nan N m: give -10000 to 10000");
  EXPECT_FALSE(a_.trigger("zero").success);
  bias(offset);
  SetCalibration::Request same;
  same.calibration = a_.call<GetCalibration>("get_calibration").calibration;
  EXPECT_TRUE(a_.call<SetCalibration>("set_calibration", same).success);
  reads(kLoad + offset);
  const auto nothing = a_.trigger("undo_bias");
  EXPECT_FALSE(nothing.success);
  EXPECT_TRUE(has(nothing.message, "nothing to undo")) << nothing.message;
}

// Every block is answered, also one that is dropped; nothing of a dropped one is published.
TEST_F(ForceSensorDriver, AcknowledgesEveryBlockInLockstep) {
  ros::NodeHandle nh;
  std::mutex mutex;
  std::vector<Ack> acks;
  const StrainSamples early = b_.block(kLoad, 5);
  std::atomic<bool> connected{false};
  const boost::function<void(const Ack::ConstPtr&)> callback = [&](const Ack::ConstPtr& ack) {
    const std::lock_guard<std::mutex> lock(mutex);
    connected = connected || ack->sequence == early.sequence;
    if (ack->sequence > early.sequence) acks.push_back(*ack);
  };
  const ros::Subscriber sub = nh.subscribe<Ack>("/ack", 100, callback);
  // it is latched: a subscriber that connects late receives it, too
  b_.pass(early);
  ASSERT_TRUE(waitFor([&] { return connected.load(); }));

  const StrainSamples good = b_.block(kLoad, 5);
  StrainSamples bad = b_.block(kLoad, 5), last = b_.block(kLoad, 5);
  bad.volts[3] = kNaN;
  for (const StrainSamples& block : {good, good, bad, last}) b_.send(block);
  ASSERT_TRUE(waitFor([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return acks.size() >= 4;
  }));
  const std::array<std::uint32_t, 4> expected{good.sequence, good.sequence, bad.sequence,
                                              last.sequence};
  const std::lock_guard<std::mutex> lock(mutex);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(acks[i].node, "sensor_b/driver");
    EXPECT_EQ(acks[i].sequence, expected[i]);
    EXPECT_EQ(acks[i].commands, 0u);
  }
  b_.newest(b_.wrench_samples_, [&](const auto& m) { return m.sequence == last.sequence; });
  std::vector<std::uint32_t> seen;
  for (const WrenchSamples& m : b_.copy(b_.wrench_samples_)) {
    if (m.sequence > early.sequence) seen.push_back(m.sequence);
  }
  EXPECT_EQ(seen, (std::vector<std::uint32_t>{good.sequence, last.sequence}));

  // a plant that repeats its block: a node after this one lacks its samples
  for (int i = 0; i < 2; ++i) b_.send(last);
  EXPECT_TRUE(waitFor([&] {
    const auto all = b_.copy(b_.wrench_samples_);
    return std::count_if(all.begin(), all.end(),
                         [&](const auto& m) { return m.sequence == last.sequence; }) == 2;
  }));
}

TEST_F(ForceSensorDriver, DiagnosticsTellRateNoiseCalibrationAndBias) {
  Diagnostics diagnostics;
  SetBias::Request bias;
  bias.bias[1] = 0.25;
  a_.call<SetBias>("set_bias", bias);
  const double sigma = 0.02;
  Feeder feeder(a_, kLoad, sigma);
  const auto samples = diagnostics.next("sensor_a/driver: samples", [&](const auto& status) {
    return status.level == 0 &&
           std::abs(std::stod(value(status, "noise rms fx [N]")) / sigma - 1) < 0.3;
  });
  EXPECT_EQ(samples.hardware_id, "simulated-a");
  EXPECT_NEAR(number(samples, "rate [Hz]"), 5000.0, 1.0);
  EXPECT_EQ(number(samples, "expected rate [Hz]"), 5000.0);
  EXPECT_EQ(value(samples, "saturated channels"), "none");
  EXPECT_EQ(number(samples, "temperature [degC]"), 21.5);
  EXPECT_EQ(value(samples, "source"), "/sensor_a/bridge");
  EXPECT_GT(number(samples, "samples"), 0);
  const auto calibration = diagnostics.next("sensor_a/driver: calibration", kAnything);
  EXPECT_EQ(calibration.level, 0);
  EXPECT_EQ(calibration.hardware_id, "simulated-a");
  EXPECT_EQ(value(calibration, "calibration id"), "sensor_a_design");
  EXPECT_EQ(number(calibration, "bias fy [N]"), 0.25);
  EXPECT_GE(number(calibration, "bias age [s]"), 0.0);
  EXPECT_LT(number(calibration, "bias age [s]"), kPatience);
}

TEST_F(ForceSensorDriver, DiagnosticsNameWhatIsWrong) {
  Diagnostics diagnostics;
  const std::string name = "sensor_a/driver: samples";
  const auto quiet = [](const auto& s) { return has(s.message, "no samples for"); };
  // silence is an error, or in lockstep (the simulator may be paused) a warning; never nothing
  EXPECT_EQ(diagnostics.next(name, quiet).level, 2);
  EXPECT_EQ(diagnostics.next("sensor_b/driver: samples", quiet).level, 1);

  // counts are reported from here on
  a_.pass(a_.block(kLoad));
  diagnostics.next(name, [](const auto& s) { return !has(s.message, "no samples"); });
  const auto before = diagnostics.next(name, kAnything);
  const auto more = [&](const auto& status, const std::string& key) {
    return number(status, key) - number(before, key);
  };
  // a repeated block, one that is missing
  const StrainSamples block = a_.block(kLoad);
  a_.pass(block);
  a_.send(block);
  a_.block(kLoad);
  a_.pass(a_.block(kLoad));
  auto status = diagnostics.next(name, [&](const auto& s) { return more(s, "lost blocks") == 1; });
  EXPECT_EQ(more(status, "duplicate blocks"), 1);

  // a malformed one, a saturated one, one of another sensor
  StrainSamples malformed = a_.block(kLoad);
  malformed.volts.pop_back();
  a_.send(malformed);
  status =
      diagnostics.next(name, [&](const auto& s) { return has(s.message, "malformed: block"); });
  EXPECT_EQ(status.level, 2);
  EXPECT_TRUE(has(status.message, "599 volts are no multiple of 6")) << status.message;
  StrainSamples saturated = a_.block(kLoad);
  saturated.saturated[5] = 0x08;
  a_.send(saturated);
  status =
      diagnostics.next(name, [](const auto& s) { return has(s.message, "saturated channels: 4"); });
  EXPECT_EQ(status.level, 2);
  EXPECT_EQ(value(status, "saturated channels"), "4");
  StrainSamples foreign = a_.block(kLoad);
  foreign.header.frame_id = "sensor_b";
  a_.send(foreign);
  status =
      diagnostics.next(name, [](const auto& s) { return has(s.message, "blocks is 'sensor_b'"); });
  EXPECT_EQ(status.level, 1);

  // a tenth of the rate
  a_.send(a_.block(std::vector<Vector6>(100, kLoad), 2e-3));
  status =
      diagnostics.next(name, [](const auto& s) { return has(s.message, "instead of 5000 Hz"); });
  EXPECT_EQ(status.level, 1);
}

// ---- bad input stops the node with one line ----

struct Ended {
  int code = -1;
  std::string output;
};

Ended runDriver(const std::string& arguments) {
  const std::string command = "timeout 30 " ASSEMBLY_CELL_BIN_DIR
                              "/force_sensor_driver __name:=bad_driver _frame_id:=x " +
                              arguments + " 2>&1";
  Ended run;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return run;
  char buffer[512];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) run.output += buffer;
  const int status = pclose(pipe);
  run.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  ros::param::del("/bad_driver");
  return run;
}

TEST(DriverBadInput, StopsTheNodeWithOneLine) {
  const std::string config = ASSEMBLY_CELL_SOURCE_DIR "/config/calibration/";
  const std::string good = "_calibration_file:=" + config + "sensor_a.yaml ";
  const std::string replay = "_source:=replay _calibration_file:=" + config + "sensor_replay.yaml ";
  const std::string drift = "_replay/file:=" ASSEMBLY_CELL_SOURCE_DIR "/test/data/drift.csv ";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "/bad_driver/calibration_file"},
      {"_calibration_file:=/none.yaml", "/none.yaml: file: value unreadable"},
      {"_calibration_file:=" ASSEMBLY_CELL_SOURCE_DIR "/package.xml", "package.xml"},
      {good + "_source:=serial", "/bad_driver/source"},
      {good + "_display_rate:=0", "/bad_driver/display_rate"},
      {good + "_dislay_rate:=10", "/bad_driver/dislay_rate"},
      {good + "_publish_displacement:=true", "volts_to_displacement is zero"},
      {replay, "/bad_driver/replay/file"},
      {replay + "_replay/file:=/none.csv", "recording '/none.csv' can't be read"},
      {replay + drift + "_replay/quantity:=volts", "drift.csv:1: 11 columns instead of 7"},
      {replay + drift + "_replay/colums:=t", "/bad_driver/replay/colums is unknown"},
      {replay + drift + "_lockstep:=true", "/bad_driver/lockstep"},
      {replay + drift + "_replay/rate:=fast _replay/loop:=true", "/bad_driver/replay/loop"},
      {"_source:=replay " + good + drift, "not the identity"},
  };
  for (const auto& [arguments, part] : cases) {
    const Ended run = runDriver(arguments);
    EXPECT_EQ(run.code, 1) << arguments << "\n" << run.output;
    EXPECT_TRUE(has(run.output, part)) << arguments << "\n" << run.output;
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  }
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::force_sensor_driver_test
