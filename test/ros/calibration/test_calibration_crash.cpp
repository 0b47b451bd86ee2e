// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// kill -9 of the server at random moments of a running calibration: every observation it has
// acknowledged is there afterwards, and every stored calibration is whole.
#include <assembly_cell/AddObservation.h>
#include <assembly_cell/ApplyLoad.h>
#include <assembly_cell/GetCalibrations.h>
#include <assembly_cell/LoadCalibration.h>
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/sensor/calibration.h"
#include "calibration_fixture.h"

namespace assembly_cell::ros_bridge::calibration_crash_test {
namespace {

namespace fs = std::filesystem;

constexpr int kKills = 52;

// What the server has acknowledged over all its starts.
class Acknowledged {
 public:
  void add(const std::string& id) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ids_.insert(id);
  }
  std::set<std::string> ids() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return ids_;
  }

 private:
  std::mutex mutex_;
  std::set<std::string> ids_;
};

// All that is stored reads as whole; returns how many calibrations there are.
int checkStore(const std::string& store) {
  int count = 0;
  for (const char* sensor : {"/sensor_a", "/sensor_b"}) {
    for (const auto& entry : fs::directory_iterator(store + sensor)) {
      if (entry.path().extension() != ".yaml") continue;  // half a temporary file counts as none
      const Calibration c = loadCalibration(entry.path().string());
      EXPECT_EQ(c.id, entry.path().stem().string());
      ++count;
    }
  }
  return count;
}

std::set<std::string> idsOf(const std::string& journal) {
  // as `calibrate solve` would read it; a line cut off by the kill is left out
  std::ifstream in(journal, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  text.resize(text.rfind('\n') + 1);
  const std::string whole = journal + ".whole.yaml";
  std::ofstream(whole, std::ios::binary) << text;
  std::set<std::string> ids;
  for (const Observation& o : readObservations(whole).observations) {
    EXPECT_TRUE(ids.insert(o.id).second) << "twice: " << o.id;
  }
  return ids;
}

TEST(Crash, LosesNoObservationAndNoCalibration) {
  test::TemporaryFolder folder;
  Server server("/sim", folder.path());
  Acknowledged acknowledged;
  std::mt19937 random(11);
  std::uniform_int_distribution<int> pause(0, 350);  // [ms]
  int stored = 0, most = 0, by_hand = 0;
  std::atomic<std::uint32_t> seed{1};
  bool was_active = false;
  const ros::WallTime begin = ros::WallTime::now();
  // the slower the machine, the less is done before a kill
  const auto worked = [&] { return acknowledged.ids().size() > 50 && by_hand > 10; };
  for (int i = 0; i < kKills || (!worked() && i < 4 * kKills); ++i) {
    server.start();
    if (HasFatalFailure()) return;

    // all that was acknowledged, and what a start makes of it
    const std::set<std::string> wanted = acknowledged.ids();
    const std::uint32_t count = server.status()->observations;
    ASSERT_GE(count, wanted.size()) << "after " << i << " kills";
    const auto active = server.call<GetCalibrations>("get_calibration");
    ASSERT_EQ(active.stored_a.size() >= active.stored_b.size(), true);  // a is written first
    ASSERT_TRUE(!was_active || active.calibrations.size() == 2) << "after " << i << " kills";
    was_active = was_active || active.calibrations.size() == 2;

    // two of three starts run the plan, the others add observations by service
    std::atomic<bool> dying{false}, answered{false};
    std::unique_ptr<Server::Client> client;
    std::thread hand;
    if (i % 3 != 2) {
      client = std::make_unique<Server::Client>(server.nh(), "calibrate", false);
      ASSERT_TRUE(client->waitForServer(ros::Duration(kPatience)));
      CalibrateSensorsGoal goal;
      goal.seed = seed;
      client->sendGoal(
          goal,
          [&](const actionlib::SimpleClientGoalState& state,
              const CalibrateSensorsResultConstPtr& result) {
            answered = true;
            if (state == actionlib::SimpleClientGoalState::SUCCEEDED && result->success) ++seed;
          },
          {},
          [&](const CalibrateSensorsFeedbackConstPtr& feedback) {
            const std::size_t end = feedback->message.rfind(" done");
            if (end != std::string::npos) acknowledged.add(feedback->message.substr(0, end));
          });
      // starts with the plan under way
      ASSERT_TRUE(waitFor([&] { return answered || server.status()->state == "calibrate"; }));
    } else {
      // what is added as unloaded is unloaded: other tests use it as their zero
      ApplyLoad rig;
      rig.request.step.test.kind = "unloaded";
      ASSERT_TRUE(callService(server.nh().resolveName("simulated_calibration_rig/apply"), rig));
      ASSERT_TRUE(rig.response.success) << rig.response.message;
      hand = std::thread([&, i] {
        AddObservation::Request request;
        request.test.kind = "unloaded";
        LoadCalibration::Request load;
        if (!active.stored_b.empty()) load.id = active.stored_b.back();
        for (int n = 0; !dying; ++n) {
          request.test.id = "hand " + std::to_string(i) + "." + std::to_string(n);
          if (server.call<AddObservation>("add_observation", request).success) {
            acknowledged.add(request.test.id);
            ++by_hand;
          }
          if (!load.id.empty()) server.call<LoadCalibration>("load", load);
        }
      });
    }
    ros::WallDuration(1e-3 * pause(random)).sleep();
    server.end(SIGKILL);
    dying = true;
    if (hand.joinable()) hand.join();
    client.reset();

    // on disk, before any repair
    const std::set<std::string> ids = idsOf(server.journal());
    for (const std::string& id : acknowledged.ids()) {
      ASSERT_EQ(ids.count(id), 1u) << id << " was acknowledged and is lost, kill " << i;
    }
    stored = checkStore(folder.path());
    most = std::max(most, static_cast<int>(ids.size()));
  }
  const double seconds = (ros::WallTime::now() - begin).toSec();
  std::cout << kKills << " kills in " << seconds << " s: " << acknowledged.ids().size()
            << " acknowledged observations (" << by_hand << " by hand), " << most << " on disk, "
            << stored << " calibrations stored\n";
  // it did work meanwhile
  EXPECT_TRUE(worked());

  // and comes to its end
  server.start();
  Server::Client client(server.nh(), "calibrate", false);
  ASSERT_TRUE(client.waitForServer(ros::Duration(kPatience)));
  CalibrateSensorsGoal goal;
  goal.seed = seed;
  goal.id = "last";
  client.sendGoal(goal);
  ASSERT_TRUE(client.waitForResult(ros::Duration(kPatience)));
  EXPECT_TRUE(client.getResult()->success) << client.getResult()->message;
  EXPECT_EQ(loadCalibration(folder.path() + "/sensor_b/last.yaml").id, "last");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::calibration_crash_test
