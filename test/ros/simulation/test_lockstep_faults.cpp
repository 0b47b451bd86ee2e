// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <signal.h>
#include <std_srvs/SetBool.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/Step.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "contact_force.h"

// A cell in lockstep whose simulator alone ends and comes back, and a peg that doesn't come free.
namespace assembly_cell::ros_bridge::lockstep_faults_test {
namespace {

using actionlib::SimpleClientGoalState;
using test::Child;
using test::executable;
using test::Record;
using test::waitFor;

constexpr double kForce = 8.0;  // of a press [N]

class LockstepFaults : public ::testing::Test {
 protected:
  void startCell() {
    startSimulator();
    for (const std::string sensor : {"sensor_a", "sensor_b"}) {
      start(sensor, "force_sensor_driver", "/lockstep/" + sensor, "driver");
    }
    start("locus_estimator", "locus_estimator", "/lockstep", "locus_estimator");
    startSupervisor();
  }
  // another one takes the place of the last
  void startSupervisor(const std::vector<std::string>& arguments = {}) {
    nodes_.erase("supervisor");
    ASSERT_TRUE(waitFor([this] { return !align_.isServerConnected(); }));
    state_.clear();
    start("supervisor", "assembly_supervisor", "/lockstep", "assembly_supervisor", arguments);
    ASSERT_TRUE(waitFor([this] {
      return align_.isServerConnected() && press_.isServerConnected() &&
             retreat_.isServerConnected() && state_.last() && runs();
    })) << nodes_.at("simulator")->output();
  }
  void start(const std::string& what, const std::string& program, const std::string& ns,
             const std::string& name, const std::vector<std::string>& arguments = {}) {
    std::vector<std::string> command{executable(program), "__ns:=" + ns, "__name:=" + name};
    command.insert(command.end(), arguments.begin(), arguments.end());
    nodes_[what] = std::make_unique<Child>(command);
  }
  void startSimulator() {
    start("simulator", "peg_hole_simulator", "/lockstep", "peg_hole_simulator");
  }
  // alone, at once; true when another boot of the plant runs on
  bool restartSimulator() {
    const auto before = plant_.last();
    nodes_.at("simulator")->signal(SIGKILL);
    startSimulator();
    return waitFor([&] { return !before || plant_.last()->life != before->life; }) && runs();
  }
  // does the cell's time pass?
  bool runs() {
    const std::size_t n = carrier_.size(), m = contacts_.size();
    return waitFor(
        [&] { return plant_.last() && carrier_.size() > n + 5 && contacts_.size() > m; });
  }

  void startPress(double force) {
    MoveToContactGoal goal;
    goal.force = force;
    press_.sendGoal(goal);
  }
  template <class Client>
  SimpleClientGoalState finish(Client& client) {
    EXPECT_TRUE(waitFor([&] { return client.getState().isDone(); }, 120.0))
        << "the goal doesn't end";
    return client.getState();
  }
  void expectPress(double force) {
    startPress(force);
    ASSERT_EQ(finish(press_).state_, SimpleClientGoalState::SUCCEEDED)
        << press_.getResult()->message;
    EXPECT_TRUE(runs());
    EXPECT_NEAR(test::liftingForce(*contacts_.last()), force, 0.1 * force);
  }

  ros::NodeHandle nh_{"/lockstep"};
  std::map<std::string, std::unique_ptr<Child>> nodes_;
  Record<PlantState> plant_{nh_, "plant_state"};
  Record<SupervisorState> state_{nh_, "assembly_supervisor/state"};
  Record<geometry_msgs::PoseStamped> carrier_{nh_, "carrier_pose"};
  Record<ContactArray> contacts_{nh_, "truth/contacts"};
  actionlib::SimpleActionClient<AlignPegAction> align_{nh_, "align", false};
  actionlib::SimpleActionClient<MoveToContactAction> press_{nh_, "move_to_contact", false};
  actionlib::SimpleActionClient<RetreatAction> retreat_{nh_, "retreat", false};
};

TEST_F(LockstepFaults, ARestartedPlantIsNamedAndTheNextGoalWorks) {
  startCell();
  const double from = carrier_.last()->pose.position.z;
  startPress(kForce);
  ASSERT_TRUE(waitFor([&] { return carrier_.last()->pose.position.z < from - 1e-3; }));
  ASSERT_TRUE(restartSimulator());
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::ABORTED);
  const std::string reason = press_.getResult()->message;
  const bool named = reason.find("restarted") != std::string::npos ||
                     reason.find("peg_hole_simulator") != std::string::npos;
  EXPECT_TRUE(named) << reason;
  expectPress(kForce);
  // and while no goal runs
  ASSERT_TRUE(restartSimulator());
  expectPress(kForce);
}

// In lockstep time waits for a node that is restarted. The goal goes on, or ends with a name.
TEST_F(LockstepFaults, ARestartedDriverOrEstimatorDoesNotStopTheCell) {
  startCell();
  const auto restart = [this](const std::string& what) {
    nodes_.at(what)->signal(SIGKILL);
    if (what == "locus_estimator") {
      start(what, what, "/lockstep", what);
    } else {
      start(what, "force_sensor_driver", "/lockstep/" + what, "driver");
    }
  };
  for (const char* what : {"sensor_a", "sensor_b", "locus_estimator"}) {
    const double from = carrier_.last()->pose.position.z;
    startPress(kForce);
    // half of the millimetre that a retreat lifts it by
    ASSERT_TRUE(waitFor([&] { return carrier_.last()->pose.position.z < from - 5e-4; }))
        << what << ": from " << from << " to " << carrier_.last()->pose.position.z << " m, "
        << press_.getState().toString();
    restart(what);
    finish(press_);
    const auto result = press_.getResult();
    EXPECT_TRUE(result->success || result->message.find(what) != std::string::npos)
        << what << ": " << result->message;
    // and while no goal runs
    restart(what);
    expectPress(kForce);
    retreat_.sendGoal(RetreatGoal());
    ASSERT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
        << retreat_.getResult()->message;
  }
}

// Noise of 2 V in a range of 5 V: a channel in eighty is at its limit at any time. The goal says so
// within half a second and what it takes to begin; with the sensor mended the next one works.
TEST_F(LockstepFaults, ASensorThatSaturatesByItselfIsNamed) {
  nh_.setParam("peg_hole_simulator/noise", 2.0);
  startCell();
  align_.sendGoal(AlignPegGoal());
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  const AlignmentReport report = align_.getResult()->report;
  EXPECT_EQ(report.reason.rfind("sensor_saturated: sensor_a: channels 1, 2, 3, 4, 5, 6 at", 0), 0U)
      << report.reason;
  EXPECT_NE(report.reason.find(": /lockstep/sensor_a/wrench_samples of /lockstep/sensor_a/driver;"),
            std::string::npos)
      << report.reason;
  EXPECT_LT(report.simulated_time, 0.6);
  ASSERT_TRUE(waitFor([this] { return state_.last()->goal.empty(); }));
  EXPECT_TRUE(state_.last()->in_contact);
  EXPECT_FALSE(state_.last()->stuck);
  nh_.deleteParam("peg_hole_simulator/noise");
  ASSERT_TRUE(restartSimulator());
  expectPress(kForce);
}

// Time stands: the goal ends all the same, and what it left is reported. A goal that is cancelled
// in the air leaves the peg at its height.
TEST_F(LockstepFaults, ACancelIsAnsweredWhileThePlantIsPaused) {
  startCell();
  startSupervisor({"_block_timeout:=600"});
  const Record<actionlib_msgs::GoalStatusArray> status(nh_, "move_to_contact/status");
  const auto pause = [](bool data) {
    std_srvs::SetBool service;
    service.request.data = data;
    EXPECT_TRUE(callService("/lockstep/peg_hole_simulator/pause", service));
  };
  // some blocks of the tare, then a cancel that has arrived
  const auto cancelInTheAir = [&] {
    pause(true);
    startPress(kForce);
    Step some;
    some.request.blocks = 6;
    ASSERT_TRUE(waitFor([&] { return state_.last()->goal == "move_to_contact"; }));
    ASSERT_TRUE(callService("/lockstep/peg_hole_simulator/step", some));
    press_.cancelGoal();
    ASSERT_TRUE(waitFor([&] {
      const auto last = status.last();
      return last && !last->status_list.empty() &&
             last->status_list.back().status == actionlib_msgs::GoalStatus::PREEMPTING;
    }));
  };
  // before a goal has shown the peg, none that is cancelled leaves it as free
  retreat_.sendGoal(RetreatGoal());
  ASSERT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
      << retreat_.getResult()->message;
  const double height = carrier_.last()->pose.position.z;
  for (int i = 0; i < 2; ++i) {
    cancelInTheAir();
    pause(false);
    EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::PREEMPTED);
    EXPECT_NEAR(carrier_.last()->pose.position.z, height, 1e-4);
    ASSERT_TRUE(waitFor([&] { return state_.last()->goal.empty(); }));
    EXPECT_FALSE(state_.last()->in_contact) << state_.last()->reason;
  }
  cancelInTheAir();
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(press_.getResult()->message, "cancelled");
  pause(false);
  expectPress(kForce);
}

// A soft coupling pressed with 20 N by one supervisor, measured by another one that bears a tenth
// of it: two attempts to free the peg are given up at its limit.
TEST_F(LockstepFaults, WhatDoesNotComeFreeIsStuckUntilRetreatFreesIt) {
  const std::vector<std::string> soft{
      "coupling.stiffness={diagonal: [5.0e3, 5.0e4, 5.0e4, 50, 50, 50], k26: 158, k35: -158}"};
  nh_.setParam("peg_hole_simulator/overrides", soft);
  nh_.setParam("assembly_supervisor/overrides", soft);
  startCell();
  expectPress(20.0);
  startSupervisor(
      {"_force_limit:=2.5", "_contact_force:=2", "_insertion_force:=1", "_insert_force:=2"});
  startPress(2.0);
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::ABORTED);
  const auto state = [this] { return *state_.last(); };
  ASSERT_TRUE(waitFor([&] { return state().stuck; })) << press_.getResult()->message;
  EXPECT_TRUE(state().in_contact);
  // goals that need a free peg are refused by name
  startPress(2.0);
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(press_.getResult()->message.rfind("in_contact: the peg got stuck", 0), 0U)
      << press_.getResult()->message;
  align_.sendGoal(AlignPegGoal());
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(align_.getResult()->report.reason.rfind("in_contact: the peg got stuck", 0), 0U)
      << align_.getResult()->report.reason;

  retreat_.sendGoal(RetreatGoal());
  ASSERT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
      << retreat_.getResult()->message;
  ASSERT_TRUE(waitFor([&] { return !state().stuck; }));
  EXPECT_FALSE(state().in_contact);
  expectPress(2.0);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::lockstep_faults_test
