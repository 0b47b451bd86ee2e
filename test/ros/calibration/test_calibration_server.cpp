// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/AddObservation.h>
#include <assembly_cell/ApplyLoad.h>
#include <assembly_cell/ConfirmLoad.h>
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/GetCalibrations.h>
#include <assembly_cell/LoadCalibration.h>
#include <assembly_cell/PlanCalibration.h>
#include <assembly_cell/SaveCalibration.h>
#include <assembly_cell/SolveCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/observations/observation_log.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/calibration.h"
#include "calibration_fixture.h"

namespace assembly_cell::ros_bridge::calibration_server_test {
namespace {

namespace fs = std::filesystem;

constexpr double kNoise = 0.5e-3;  // of the strain that the bench feeds [V]

CalibrationTest testOf(const std::string& kind, const std::string& sensor = "") {
  CalibrationTest test;
  test.kind = kind;
  test.sensor = sensor;
  return test;
}
CalibrationTest weight(double mass) {
  CalibrationTest test = testOf("weight", "a");
  test.mass = mass;
  test.direction.z = -1.0;
  return test;
}

// Feeds `strain` of both sensors, 20 samples every 4 ms, until it goes out of scope.
class Strain {
 public:
  explicit Strain(ros::NodeHandle& nh) {
    for (const char* sensor : {"sensor_a", "sensor_b"}) {
      pubs_.push_back(nh.advertise<StrainSamples>(std::string(sensor) + "/strain", 100));
    }
    thread_ = std::thread([this] { run(); });
  }
  ~Strain() {
    stop_ = true;
    thread_.join();
  }
  bool connected() const {
    return pubs_[0].getNumSubscribers() > 0 && pubs_[1].getNumSubscribers() > 0;
  }

  std::atomic<double> volts_{0.1}, slope_{0.0};  // of all channels of sensor_a [V], [V/s]
  std::atomic<int> saturated_{0};
  std::atomic<bool> silent_b_{false};
  std::atomic<bool> held_{false};  // blocks wait, as in the queue of a busy machine
  std::atomic<int> waiting_{0};    // of sensor_a

 private:
  void send(std::size_t side, const StrainSamples& block) {
    queue_[side].push_back(block);
    if (!held_) {
      for (const StrainSamples& next : queue_[side]) pubs_[side].publish(next);
      queue_[side].clear();
    }
    waiting_ = static_cast<int>(queue_[0].size());
  }
  void run() {
    NormalSource normal(3);
    StrainSamples block;
    block.period = 2e-4;
    const ros::Time start = ros::Time::now();
    for (std::uint32_t n = 0; !stop_; ++n) {
      block.sequence = n;
      block.header.stamp = start + ros::Duration(n * 20 * block.period);
      for (std::size_t side = 0; side < (silent_b_ ? 1u : 2u); ++side) {
        block.volts.clear();
        for (int k = 0; k < 120; ++k) {
          const double t = (n * 20 + k / 6) * block.period;
          block.volts.push_back((side == 0 ? volts_ + slope_ * t : 0.2) + kNoise * normal());
        }
        block.saturated.assign(20, side == 0 ? static_cast<std::uint8_t>(saturated_.load()) : 0);
        send(side, block);
      }
      ros::WallDuration(0.004).sleep();
    }
  }

  std::vector<ros::Publisher> pubs_;
  std::vector<StrainSamples> queue_[2];
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

AddObservation::Response add(Server& server, const CalibrationTest& test) {
  AddObservation::Request request;
  request.test = test;
  return server.call<AddObservation>("add_observation", request);
}

// ---- the bench: strain played by the test ----

class Bench : public ::testing::Test {
 protected:
  void SetUp() override {
    strain_ = std::make_unique<Strain>(server_.nh());
    start();
  }
  void start() {
    server_.start();
    ASSERT_TRUE(waitFor([&] { return strain_->connected(); }));
  }
  void refused(const CalibrationTest& test, const std::string& part) {
    const std::vector<std::string> before = recordsOf(server_.journal());
    const auto response = add(server_, test);
    EXPECT_FALSE(response.success);
    EXPECT_TRUE(has(response.message, part)) << response.message;
    EXPECT_FALSE(has(response.message, "\n"));
    EXPECT_EQ(recordsOf(server_.journal()), before);
  }

  test::TemporaryFolder folder_;
  Server server_{"/bench", folder_.path()};
  std::unique_ptr<Strain> strain_;
};

// The mean of a window, on disk before the answer; one sensor or both, as the test needs.
TEST_F(Bench, AveragesASettledWindow) {
  const auto both = add(server_, testOf("unloaded"));
  ASSERT_TRUE(both.success) << both.message;
  EXPECT_EQ(recordsOf(server_.journal()).size(), 1u);
  strain_->volts_ = 0.7;
  CalibrationTest test = weight(3.0);
  test.id = "hook \"1\": {a}";
  const auto one = add(server_, test);
  ASSERT_TRUE(one.success) << one.message;
  EXPECT_EQ(one.observations, 2u);
  // six standard deviations of a mean of 200, rounded to half a step of 16 bit
  const double tolerance = 6 * kNoise / std::sqrt(200.0);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_NEAR(both.volts_a[k], 0.1, tolerance);
    EXPECT_NEAR(both.volts_b[k], 0.2, tolerance);
    EXPECT_NEAR(one.volts_a[k], 0.7, tolerance);
    EXPECT_EQ(one.volts_b[k], 0.0);
  }
  // the journal is an observation file
  const ObservationSet set = readObservations(server_.journal());
  ASSERT_EQ(set.observations.size(), 2u);
  EXPECT_EQ(set.sensor.a.serial_number, "simulated-a");
  EXPECT_EQ(set.observations[1].kind, ObservationKind::kWeight);
  EXPECT_EQ(set.observations[1].id, test.id);
  EXPECT_EQ(set.observations[1].mass, 3.0);
  EXPECT_EQ(set.observations[1].reading.a->samples, 200);
  EXPECT_FALSE(set.observations[1].reading.b.has_value());
  EXPECT_EQ(set.observations[1].reading.a->volts[2], one.volts_a[2]);
}

TEST_F(Bench, RefusesWhatItCannotUse) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused(testOf("wight", "a"), "kind is 'wight'");
  refused(testOf("weight", "c"), "sensor is 'c'");
  refused(weight(-1.0), "mass");
  refused(weight(nan), "mass");
  CalibrationTest test = weight(1.0);
  test.direction.z = -2.0;
  refused(test, "direction");
  test = testOf("reacting");
  test.pose.orientation.w = 3.0;
  refused(test, "pose");
  test = testOf("reacting");
  test.pose_covariance.resize(5);
  refused(test, "pose_covariance has 5 entries");
  test = testOf("displacement", "a");
  test.gauges = {1e-5, 2e-5};
  refused(test, "gauge");
  test = weight(1.0);
  test.id = "two\nlines";
  refused(test, "control characters");

  strain_->saturated_ = 0x05;
  refused(weight(1.0), "sensor_a: channel 1, 3 saturated");
  strain_->saturated_ = 0;
  strain_->slope_ = 1.0;  // 40 mV in a window
  refused(weight(1.0), "unsettled");
  strain_->slope_ = 0.0;
  EXPECT_TRUE(add(server_, weight(1.0)).success);
  // a sensor that isn't needed may be silent
  strain_->silent_b_ = true;
  refused(testOf("unloaded"), "sensor_b: no samples on /bench/sensor_b/strain for 5 s");
  EXPECT_TRUE(add(server_, weight(1.0)).success);
  EXPECT_TRUE(add(server_, testOf("unloaded", "a")).success);
}

// A load that still moves at the call is waited for.
TEST_F(Bench, WaitsUntilItSettles) {
  strain_->slope_ = 1.0;
  auto answer = std::async(std::launch::async, [&] { return add(server_, weight(1.0)); });
  ros::WallDuration(0.15).sleep();  // of 0.4 s; what is asserted doesn't hang on it
  strain_->slope_ = 0.0;
  const auto response = answer.get();
  if (response.success) {
    EXPECT_NEAR(response.volts_a[0], 0.1, 6 * kNoise / std::sqrt(200.0));
  } else {
    EXPECT_TRUE(has(response.message, "unsettled")) << response.message;
  }
}

// Samples measured before the call may arrive after it on a busy machine; they belong to the load
// before.
TEST_F(Bench, IgnoresWhatWasMeasuredBeforeTheCall) {
  ASSERT_TRUE(add(server_, testOf("unloaded")).success);
  strain_->held_ = true;
  // more than a window of the load before
  const int earlier = strain_->waiting_ + 15;
  ASSERT_TRUE(waitFor([&] { return strain_->waiting_ > earlier; }));
  strain_->volts_ = 0.7;
  const int before = strain_->waiting_;
  ASSERT_TRUE(waitFor([&] { return strain_->waiting_ > before + 1; }));
  auto answer = std::async(std::launch::async, [this] { return add(server_, weight(3.0)); });
  // the call waits for samples
  EXPECT_EQ(answer.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout);
  strain_->held_ = false;
  const auto one = answer.get();
  ASSERT_TRUE(one.success) << one.message;
  EXPECT_NEAR(one.volts_a[0], 0.7, 6 * kNoise / std::sqrt(200.0));
}

TEST_F(Bench, RemovesTheLastAndResets) {
  EXPECT_TRUE(has(server_.trigger("remove_last").message, "nothing to remove"));
  for (const double mass : {1.0, 2.0, 3.0}) ASSERT_TRUE(add(server_, weight(mass)).success);
  EXPECT_TRUE(server_.trigger("remove_last").success);
  EXPECT_EQ(countOf(recordsOf(server_.journal()), "mass: 3"), 0u);
  EXPECT_EQ(recordsOf(server_.journal()).size(), 2u);

  // over a restart
  server_.end(SIGKILL);
  start();
  EXPECT_TRUE(waitFor([&] { return server_.status()->observations == 2; }));
  EXPECT_TRUE(server_.trigger("reset").success);
  EXPECT_TRUE(recordsOf(server_.journal()).empty());
  EXPECT_EQ(recordsOf(server_.journal() + ".previous").size(), 2u);
  EXPECT_TRUE(waitFor([&] { return server_.status()->observations == 0; }));
}

// A plan is evaluated before the first measurement; that of the thesis is refused with what it
// lacks.
TEST_F(Bench, PlansAndSaysWhatIsMissing) {
  PlanCalibration::Request request;
  auto plan = server_.call<PlanCalibration>("plan", request);
  EXPECT_TRUE(plan.success) << plan.message;
  EXPECT_EQ(plan.design.unknowns, 72u);
  EXPECT_EQ(plan.design.rank, 72u);
  EXPECT_GE(plan.steps.size(), 44u);
  for (const LoadStep& step : plan.steps) EXPECT_FALSE(step.text.empty());
  request.plan = "thesis_fixed";
  plan = server_.call<PlanCalibration>("plan", request);
  EXPECT_FALSE(plan.success);
  EXPECT_TRUE(has(plan.message, "rank") && has(plan.message, "21 of 36")) << plan.message;
  request.plan = "thesis_shifted";
  plan = server_.call<PlanCalibration>("plan", request);
  EXPECT_TRUE(has(plan.message, "30 of 36")) << plan.message;
  request.plan = "displacement";
  EXPECT_TRUE(server_.call<PlanCalibration>("plan", request).success);
  request.plan = "../etc";
  EXPECT_TRUE(has(server_.call<PlanCalibration>("plan", request).message, "plan is '../etc'"));

  // without loads there is nothing to solve, with one the answer names what to add
  EXPECT_TRUE(has(server_.call<SolveCalibration>("solve").message, "add reacting tests"));
  ASSERT_TRUE(add(server_, testOf("unloaded")).success);
  ASSERT_TRUE(add(server_, weight(3.0)).success);
  const auto solution = server_.call<SolveCalibration>("solve");
  EXPECT_FALSE(solution.success);
  EXPECT_TRUE(has(solution.message, "add")) << solution.message;
  EXPECT_FALSE(solution.result.refusals.empty());
  EXPECT_TRUE(has(server_.call<SaveCalibration>("save").message, "not accepted"));
  ASSERT_TRUE(add(server_, weight(2.0)).success);
  EXPECT_TRUE(has(server_.call<SaveCalibration>("save").message, "call solve"));
}

// Without a rig a person brings about each load and confirms it; a refusal leaves the step open.
TEST_F(Bench, AnActionWaitsForThePerson) {
  EXPECT_TRUE(has(server_.call<ConfirmLoad>("confirm").message, "no action waits"));
  Server::Client client(server_.nh(), "calibrate", false);
  ASSERT_TRUE(client.waitForServer(ros::Duration(kPatience)));
  std::mutex mutex;
  std::string instruction;
  client.sendGoal(CalibrateSensorsGoal(), {}, {},
                  [&](const CalibrateSensorsFeedbackConstPtr& feedback) {
                    const std::lock_guard<std::mutex> lock(mutex);
                    if (feedback->state == "waiting for confirmation") {
                      instruction = feedback->message;
                    }
                  });
  const auto waits = [&] {
    return waitFor([&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return !instruction.empty();
    });
  };
  ASSERT_TRUE(waits());
  // others are kept out meanwhile
  EXPECT_TRUE(has(add(server_, weight(1.0)).message, "the action calibrate is under way"));
  EXPECT_TRUE(has(server_.trigger("reset").message, "under way"));

  // the first step is an unloaded reading
  strain_->saturated_ = 1;
  auto confirmed = server_.call<ConfirmLoad>("confirm");
  EXPECT_FALSE(confirmed.success);
  EXPECT_TRUE(has(confirmed.message, "saturated")) << confirmed.message;
  strain_->saturated_ = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex);
    instruction.clear();
  }
  confirmed = server_.call<ConfirmLoad>("confirm");
  ASSERT_TRUE(confirmed.success) << confirmed.message;
  ASSERT_TRUE(waits());
  // a load that isn't the plan's
  ConfirmLoad::Request changed;
  changed.changed = true;
  changed.test = weight(1.2345);
  EXPECT_TRUE(server_.call<ConfirmLoad>("confirm", changed).success);
  client.cancelGoal();
  ASSERT_TRUE(client.waitForResult(ros::Duration(kPatience)));
  EXPECT_EQ(client.getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(client.getResult()->observations, 2u);
  const auto records = recordsOf(server_.journal());
  ASSERT_EQ(records.size(), 2u);
  EXPECT_TRUE(has(records[0], "kind: unloaded, id: \"recommended/1/1\"")) << records[0];
  EXPECT_TRUE(has(records[1], "mass: 1.2345") && has(records[1], "recommended/1/2"));

  // the same goal goes on, after a zero
  client.sendGoal(CalibrateSensorsGoal());
  ASSERT_TRUE(waitFor([&] { return server_.call<ConfirmLoad>("confirm").success; }));
  EXPECT_TRUE(has(recordsOf(server_.journal()).back(), "id: \"recommended/1/zero/3\""));
  client.cancelGoal();
  EXPECT_TRUE(client.waitForResult(ros::Duration(kPatience)));
}

// ---- stored calibrations ----

Calibration calibrationOf(const std::string& sensor, const std::string& id, double scale) {
  Calibration c =
      loadCalibration(ASSEMBLY_CELL_SOURCE_DIR "/config/calibration/" + sensor + ".yaml");
  c.id = id;
  c.volts_to_wrench *= scale;
  return c;
}

// Corrupt, foreign or renamed files and ids that are paths are refused; the active ones stay.
TEST_F(Bench, RefusesCorruptAndForeignFiles) {
  const std::string a = folder_.path() + "/sensor_a/", b = folder_.path() + "/sensor_b/";
  EXPECT_FALSE(server_.call<GetCalibrations>("get_calibration").success);
  saveCalibration(calibrationOf("sensor_a", "good", 1.0), a + "good.yaml");
  saveCalibration(calibrationOf("sensor_b", "good", 1.0), b + "good.yaml");
  LoadCalibration::Request request;
  request.id = "good";
  const auto loaded = server_.call<LoadCalibration>("load", request);
  ASSERT_TRUE(loaded.success) << loaded.message;
  EXPECT_TRUE(has(loaded.message, "isn't there")) << loaded.message;  // no driver on the bench

  saveCalibration(calibrationOf("sensor_b", "good", 1.0), a + "foreign.yaml");
  fs::copy_file(a + "good.yaml", a + "renamed.yaml");
  std::string content = contentOf(a + "good.yaml");
  content[content.find("data: [") + 9] ^= 1;
  std::ofstream(a + "corrupt.yaml") << content;
  std::ofstream(a + "cut.yaml") << content.substr(0, content.size() / 2);
  std::ofstream(a + "empty.yaml");
  fs::create_directory(a + "folder.yaml");
  saveCalibration(calibrationOf("sensor_a", "only_a", 1.0), a + "only_a.yaml");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"foreign", "is of sensor 'simulated-b'"},
      {"renamed", "holds calibration 'good'"},
      {"corrupt", "checksum"},
      {"cut", "cut.yaml"},
      {"empty", "no calibration"},
      {"folder", "folder"},
      {"only_a", "sensor_b has no calibration 'only_a' stored: give one of: good"},
      {"none", "no calibration 'none' stored"},
      {"../sensor_b/good", "calibration id is"},
      {"/etc/passwd", "calibration id is"},
      {"", "calibration id is"},
      {".", "calibration id is"},
      {std::string(5000, 'x'), "calibration id is"},
      {"a\nb", "calibration id is"}};
  for (const auto& [id, part] : cases) {
    request.id = id;
    const auto response = server_.call<LoadCalibration>("load", request);
    EXPECT_FALSE(response.success) << id;
    EXPECT_TRUE(has(response.message, part)) << id << ": " << response.message;
    EXPECT_FALSE(has(response.message, "\n"));
    const auto active = server_.call<GetCalibrations>("get_calibration");
    ASSERT_EQ(active.calibrations.size(), 2u);
    EXPECT_EQ(active.calibrations[0].id, "good");
    EXPECT_EQ(active.calibrations[1].id, "good");
  }
  request.id = "only_a";
  request.sensor = "sensor_a";
  EXPECT_TRUE(server_.call<LoadCalibration>("load", request).success);
  request.sensor = "sensor_c";
  EXPECT_TRUE(has(server_.call<LoadCalibration>("load", request).message, "sensor is 'sensor_c'"));

  // active after a restart, and latched
  server_.end(SIGKILL);
  std::ofstream(a + "x.yaml.tmp123") << "half";
  start();
  EXPECT_FALSE(fs::exists(a + "x.yaml.tmp123"));
  auto active = server_.call<GetCalibrations>("get_calibration");
  ASSERT_EQ(active.calibrations.size(), 2u);
  EXPECT_EQ(active.calibrations[0].id, "only_a");
  EXPECT_EQ(active.calibrations[0].header.frame_id, "sensor_a");
  EXPECT_EQ(active.stored_b, std::vector<std::string>{"good"});
  const auto latched = ros::topic::waitForMessage<SensorCalibration>(
      "/bench/calibration_server/sensor_b/calibration", ros::Duration(kPatience));
  ASSERT_TRUE(latched);
  EXPECT_EQ(latched->id, "good");

  // damage found at the start is reported, and the server runs
  server_.end(SIGTERM);
  fs::copy_file(a + "corrupt.yaml", a + "only_a.yaml", fs::copy_options::overwrite_existing);
  start();
  active = server_.call<GetCalibrations>("get_calibration");
  ASSERT_EQ(active.calibrations.size(), 1u);
  EXPECT_EQ(active.calibrations[0].id, "good");
}

// ---- the tool and the server have one store ----

int calibrate(const std::string& arguments) {
  const int status = std::system((ASSEMBLY_CELL_BIN_DIR "/calibrate " + arguments).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

SensorCalibration published(const std::string& sensor, const std::string& id) {
  SensorCalibration found;
  EXPECT_TRUE(waitFor([&] {
    const auto message = ros::topic::waitForMessage<SensorCalibration>(
        "/bench/calibration_server/" + sensor + "/calibration", ros::Duration(kPatience));
    if (message) found = *message;
    return found.id == id;
  }));
  return found;
}

using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

// to the last bit
void expectSame(const Calibration& file, const SensorCalibration& message) {
  const auto same = [](const auto& matrix, const auto& data) {
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
    EXPECT_TRUE(std::equal(rows.data(), rows.data() + rows.size(), data.begin(), data.end()));
  };
  EXPECT_EQ(file.id, message.id);
  EXPECT_EQ(file.serial_number, message.serial_number);
  EXPECT_EQ(file.observations_digest, message.observations_digest);
  EXPECT_FALSE(file.volts_to_displacement.isZero(0.0));
  EXPECT_EQ(file.volts_to_wrench, RowMajor6::Map(message.volts_to_wrench.data()));
  EXPECT_EQ(file.volts_to_displacement, RowMajor6::Map(message.volts_to_displacement.data()));
  EXPECT_EQ(file.zero_volts, Vector6::Map(message.zero_volts.data()));
  same(file.displacement_products, message.displacement_products);
  same(file.wrench_covariance, message.wrench_covariance);
  same(file.displacement_covariance, message.displacement_covariance);
}

// An observation file of the simulated bench: force tests of linear sensors, and displacements.
void simulateSession(const std::string& folder) {
  ASSERT_EQ(calibrate("plan recommended --nonlinearity 0 --simulate " + folder +
                      "/force.yaml > /dev/null 2>&1"),
            0);
  ASSERT_EQ(calibrate("plan displacement --nonlinearity 0 --simulate " + folder +
                      "/displacement.yaml > /dev/null 2>&1"),
            0);
  const std::string moved = contentOf(folder + "/displacement.yaml");
  const std::size_t first = moved.find("observations:\n") + std::string("observations:\n").size();
  std::ofstream(folder + "/all.yaml") << contentOf(folder + "/force.yaml") << moved.substr(first);
}

// What the tool saves the server loads and publishes, displacement and all; a file of forces alone
// keeps the active displacement, also over a restart.
TEST_F(Bench, LoadsWhatTheToolSaves) {
  const test::TemporaryFolder work;
  simulateSession(work.path());
  const auto save = [&](const std::string& file, const std::string& id) {
    return calibrate("solve " + work.path() + "/" + file + " --save " + folder_.path() + " --id " +
                     id + " > /dev/null 2>&1");
  };
  ASSERT_EQ(save("all.yaml --displacement", "whole"), 0);
  LoadCalibration::Request request;
  request.id = "whole";
  auto loaded = server_.call<LoadCalibration>("load", request);
  ASSERT_TRUE(loaded.success) << loaded.message;
  for (const std::string sensor : {"sensor_a", "sensor_b"}) {
    expectSame(loadCalibration(folder_.path() + "/" + sensor + "/whole.yaml"),
               published(sensor, "whole"));
  }
  // into a store with an active calibration the tool saves its displacement, too
  ASSERT_EQ(save("force.yaml", "force"), 0);
  request.id = "force";
  loaded = server_.call<LoadCalibration>("load", request);
  ASSERT_TRUE(loaded.success) << loaded.message;
  expectSame(loadCalibration(folder_.path() + "/sensor_a/force.yaml"),
             published("sensor_a", "force"));

  // a file from elsewhere, without a displacement
  const Calibration whole = loadCalibration(folder_.path() + "/sensor_a/force.yaml");
  Calibration bare;
  bare.id = "bare";
  bare.serial_number = whole.serial_number;
  bare.date = whole.date;
  bare.volts_to_wrench = whole.volts_to_wrench;
  saveCalibration(bare, folder_.path() + "/sensor_a/bare.yaml");
  request.id = "bare";
  request.sensor = "sensor_a";
  loaded = server_.call<LoadCalibration>("load", request);
  ASSERT_TRUE(loaded.success) << loaded.message;
  EXPECT_TRUE(has(loaded.message, "sensor_a keeps the displacement of force")) << loaded.message;
  for (int run = 0; run < 2; ++run) {
    const SensorCalibration now = published("sensor_a", "bare");
    EXPECT_EQ(whole.volts_to_displacement, RowMajor6::Map(now.volts_to_displacement.data()));
    if (run == 0) {
      server_.end(SIGKILL);
      start();
    }
  }
}

// Calibrations that calibrate solve once put below the serial number are found.
TEST_F(Bench, LoadsFromTheOldPlace) {
  fs::create_directory(folder_.path() + "/simulated-a");
  saveCalibration(calibrationOf("sensor_a", "old", 1.0), folder_.path() + "/simulated-a/old.yaml");
  LoadCalibration::Request request;
  request.id = "old";
  request.sensor = "sensor_a";
  const auto loaded = server_.call<LoadCalibration>("load", request);
  EXPECT_TRUE(loaded.success) << loaded.message;
  EXPECT_EQ(server_.call<GetCalibrations>("get_calibration").stored_a,
            std::vector<std::string>{"old"});
}

// What the server saves the tool reads, and its store takes what the tool solves from the journal.
TEST_F(Bench, TheToolReadsWhatTheServerSaves) {
  // a journal as a session would leave it
  const test::TemporaryFolder work;
  simulateSession(work.path());
  server_.end(SIGTERM);
  const ObservationSet set = readObservations(work.path() + "/all.yaml");
  {
    ObservationLog log(server_.journal(), observationHeader(readObservations(server_.journal())));
    for (const Observation& o : set.observations) log.append(observationLine(o));
  }
  start();
  const auto solved = server_.call<SolveCalibration>("solve");
  ASSERT_TRUE(solved.success) << solved.message;
  SaveCalibration::Request request;
  request.id = "ours";
  const auto saved = server_.call<SaveCalibration>("save", request);
  ASSERT_TRUE(saved.success) << saved.message;
  EXPECT_EQ(saved.id, "ours");
  for (const std::string sensor : {"sensor_a", "sensor_b"}) {
    const std::string path = folder_.path() + "/" + sensor + "/ours.yaml";
    EXPECT_EQ(
        calibrate("check " + path + " --observations " + work.path() + "/force.yaml > /dev/null"),
        0);
    expectSame(loadCalibration(path), published(sensor, "ours"));
  }
  // the same observations, the same maps
  ASSERT_EQ(calibrate("solve " + server_.journal() + " --displacement --save " + folder_.path() +
                      " --id tools > /dev/null 2>&1"),
            0);
  for (const std::string sensor : {"sensor_a", "sensor_b"}) {
    Calibration tools = loadCalibration(folder_.path() + "/" + sensor + "/tools.yaml");
    tools.id = "ours";
    expectSame(tools, published(sensor, "ours"));
  }
}

// ---- bad input stops the node with one line ----

struct Ended {
  int code = -1;
  std::string output;
};

Ended run(const std::string& arguments) {
  const std::string command = "timeout 30 " ASSEMBLY_CELL_BIN_DIR "/" + arguments + " 2>&1";
  Ended ended;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return ended;
  char buffer[512];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) ended.output += buffer;
  const int status = pclose(pipe);
  ended.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  ros::param::del("/bad_server");
  return ended;
}

TEST(CalibrationBadInput, StopsTheNodesWithOneLine) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() + "/observations.yaml") << "hello\n";
  const std::string server = "calibration_server __name:=bad_server ";
  const std::string serials = "_sensor_a/serial_number:=a _sensor_b/serial_number:=b ";
  const std::string rig = "simulated_calibration_rig __name:=bad_server ";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {server, "/bad_server/sensor_a/serial_number"},
      {server + serials + "_store:=here", "/bad_server/store"},
      {server + serials + "_store:=/proc/none", "/proc/none"},
      {server + serials + "_store:=" + folder.path(), "no journal"},
      {server + serials + "_window:=2", "/bad_server/window"},
      {server + serials + "_windw:=200", "/bad_server/windw"},
      {server + serials + "_plan:=thesis_fixed", "/bad_server/plan"},
      {server + serials + "_accuracy/mas:=1", "/bad_server/accuracy/mas"},
      {rig + "_bits:=12", "/bad_server/bits"},
      {rig + "_noise:=-1", "/bad_server/noise"},
      {rig + "_bit:=10", "/bad_server/bit is unknown"},
  };
  for (const auto& [arguments, part] : cases) {
    const Ended ended = run(arguments);
    EXPECT_EQ(ended.code, 1) << arguments << "\n" << ended.output;
    EXPECT_TRUE(has(ended.output, part)) << arguments << "\n" << ended.output;
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
  }
  EXPECT_EQ(contentOf(folder.path() + "/observations.yaml"), "hello\n");
}

TEST(CalibrationBadInput, ASecondServerOfTheSameStoreEnds) {
  const test::TemporaryFolder folder;
  Server server("/bench", folder.path());
  server.start();
  const Ended ended =
      run("calibration_server __name:=bad_server _sensor_a/serial_number:=a "
          "_sensor_b/serial_number:=b _store:=" +
          folder.path());
  EXPECT_EQ(ended.code, 1);
  EXPECT_TRUE(has(ended.output, "in use by another process")) << ended.output;
  EXPECT_TRUE(server.alive());
}

// ---- the simulated cell: rig, drivers, server ----

class CalibrationCell : public ::testing::Test {
 protected:
  void SetUp() override {
    server_.start();
    client_ = std::make_unique<Server::Client>(server_.nh(), "calibrate", false);
    ASSERT_TRUE(client_->waitForServer(ros::Duration(kPatience)));
    ASSERT_TRUE(ros::topic::waitForMessage<WrenchSamples>("/sim/sensor_a/wrench_samples",
                                                          ros::Duration(kPatience)));
  }
  CalibrateSensorsResult result() {
    EXPECT_TRUE(client_->waitForResult(ros::Duration(2 * kPatience)));
    return *client_->getResult();
  }

  test::TemporaryFolder folder_;
  Server server_{"/sim", folder_.path()};
  std::unique_ptr<Server::Client> client_;
};

// A whole plan: cancelled half way, continued, solved, stored, active in the drivers, which
// then read a known weight right.
TEST_F(CalibrationCell, CalibratesBothSensors) {
  CalibrateSensorsGoal goal;
  goal.id = "first";
  std::atomic<std::uint32_t> step{0}, steps{0};
  client_->sendGoal(goal, {}, {}, [&](const CalibrateSensorsFeedbackConstPtr& feedback) {
    step = feedback->step;
    steps = feedback->steps;
  });
  ASSERT_TRUE(waitFor([&] { return step >= 5; }));
  EXPECT_TRUE(waitFor([&] { return server_.status()->state == "calibrate"; }));
  client_->cancelGoal();
  const CalibrateSensorsResult stopped = result();
  EXPECT_EQ(client_->getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_TRUE(has(stopped.message, "cancelled")) << stopped.message;
  EXPECT_GE(stopped.observations, 5u);
  EXPECT_EQ(recordsOf(server_.journal()).size(), stopped.observations);
  EXPECT_LT(stopped.observations, steps);

  const ros::WallTime begin = ros::WallTime::now();
  client_->sendGoal(goal);
  const CalibrateSensorsResult done = result();
  ASSERT_TRUE(done.success) << done.message;
  std::cout << done.message << " (" << (ros::WallTime::now() - begin).toSec() << " s)\n";
  EXPECT_GE(done.resumed, 5u);
  EXPECT_EQ(done.id, "first");
  EXPECT_EQ(done.observations, steps + 1);  // and the zero of going on
  EXPECT_EQ(done.result.unknowns, 72u);
  EXPECT_EQ(done.result.rank, 72u);
  EXPECT_GE(done.result.dof, 150);
  EXPECT_GT(done.result.p, 1e-3);
  EXPECT_EQ(done.result.model, "linear");
  for (std::size_t k = 0; k < 6; ++k) {
    // gate `predicted_sd` of docs/how_to/calibration.md: 0.1 % of 50 N, 2 N·m
    EXPECT_GT(done.result.predicted_sd_a[k], 0.0);
    EXPECT_LT(done.result.predicted_sd_b[k], k < 3 ? 0.05 : 0.002);
  }

  // stored, complete, and active everywhere
  for (const char* sensor : {"sensor_a", "sensor_b"}) {
    const Calibration c = loadCalibration(folder_.path() + "/" + sensor + "/first.yaml");
    EXPECT_EQ(c.id, "first");
    EXPECT_EQ(c.observations_digest.rfind("crc32:", 0), 0u);
    EXPECT_EQ(c.wrench_covariance.rows(), 36);
    GetCalibration call;
    ASSERT_TRUE(callService(std::string("/sim/") + sensor + "/driver/get_calibration", call));
    EXPECT_EQ(call.response.calibration.id, "first");
    EXPECT_EQ(call.response.calibration.observations_digest, c.observations_digest);
  }
  const auto active = server_.call<GetCalibrations>("get_calibration");
  EXPECT_EQ(active.calibrations.size(), 2u);
  EXPECT_EQ(active.stored_a, std::vector<std::string>{"first"});
  SaveCalibration::Request save;
  save.id = "first";
  EXPECT_TRUE(has(server_.call<SaveCalibration>("save", save).message, "taken"));
  save.id = "../first";
  EXPECT_FALSE(server_.call<SaveCalibration>("save", save).success);

  // 2 kg that were no part of it, at the sensor's reference point
  ApplyLoad load;
  load.request.step.test = weight(2.0);
  ASSERT_TRUE(callService("/sim/simulated_calibration_rig/apply", load));
  ASSERT_TRUE(load.response.success) << load.response.message;
  Vector6 mean = Vector6::Zero();
  ASSERT_TRUE(waitFor([&] {
    const auto block = ros::topic::waitForMessage<WrenchSamples>("/sim/sensor_a/wrench_samples",
                                                                 ros::Duration(kPatience));
    if (!block || block->header.stamp < load.response.since) return false;
    mean.setZero();
    for (std::size_t k = 0; k < 100; ++k) mean += Vector6::Map(&block->wrench[6 * k]) / 100.0;
    return true;
  }));
  // 0.1 % of full scale, and the direction's error of 0.3 mrad, three of them
  EXPECT_NEAR(mean[2], -2.0 * 9.80665, 0.05);
  EXPECT_NEAR(mean[0], 0.0, 0.05 + 1e-3 * 20);
  EXPECT_NEAR(mean[1], 0.0, 0.05 + 1e-3 * 20);
  for (int k = 3; k < 6; ++k) EXPECT_NEAR(mean[k], 0.0, 0.003);

  // by hand: solve again, the same; a thesis solution can't be saved
  const auto again = server_.call<SolveCalibration>("solve");
  EXPECT_TRUE(again.success);
  EXPECT_NEAR(again.result.chi2, done.result.chi2, 1e-6 * done.result.chi2);
  SolveCalibration::Request thesis;
  thesis.procedure = "thesis";
  EXPECT_FALSE(server_.call<SolveCalibration>("solve", thesis).success);
  EXPECT_FALSE(server_.call<SaveCalibration>("save").success);
}

// A rig that goes away ends the action with a reason, and nothing is lost.
TEST_F(CalibrationCell, EndsWithAReasonWhenTheRigIsGone) {
  server_.end(SIGTERM);
  server_.start({"_rig:=missing/apply", "_source_timeout:=0.5"});
  client_ = std::make_unique<Server::Client>(server_.nh(), "calibrate", false);
  ASSERT_TRUE(client_->waitForServer(ros::Duration(kPatience)));
  client_->sendGoal(CalibrateSensorsGoal());
  const CalibrateSensorsResult answer = result();
  EXPECT_FALSE(answer.success);
  EXPECT_TRUE(has(answer.message, "service /sim/missing/apply doesn't answer")) << answer.message;
  EXPECT_TRUE(waitFor([&] { return server_.status()->state == "idle"; }));
  ros::param::set("/sim/calibration_server/rig", "simulated_calibration_rig/apply");
  ros::param::set("/sim/calibration_server/source_timeout", 2.0);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::calibration_server_test
