// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <signal.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/Lease.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "contact_force.h"

// A cell with bridge and emulated arm by the (slowed) wall clock, whose bridge or arm dies during
// goals and is restarted alone. Times are cell time, from stamps.
namespace assembly_cell::ros_bridge::arm_faults_test {
namespace {

using actionlib::SimpleClientGoalState;
using test::Child;
using test::executable;
using test::Record;
using test::waitFor;

constexpr double kTimeout = 0.5;  // of arm_faults.test [s]
constexpr double kBlock = 0.02;   // [s]

class ArmFaults : public ::testing::Test {
 protected:
  void SetUp() override {
    start("peg_hole_simulator", "",
          {"carrier_pose:=arm/simulated_pose", "exciter:=arm/exciter", "lease:=arm/lease",
           "plant_state:=arm/plant_state"});
    start("emulate_arm");
    start("arm_bridge");
    start("force_sensor_driver", "/sensor_a", {"__name:=driver"});
    start("force_sensor_driver", "/sensor_b", {"__name:=driver"});
    start("locus_estimator");
    start("assembly_supervisor");
    ASSERT_TRUE(waitFor([this] {
      return align_.isServerConnected() && press_.isServerConnected() && plant_.last() &&
             simulator_.last() && state_.last() && joints_.size() > 0 && leases_.connected() &&
             contacts_.connected();
    }));
  }
  void start(const std::string& program, const std::string& below = "",
             const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {executable(program), "__ns:=/arm_faults" + below};
    if (more.empty() || more[0].rfind("__name", 0) != 0) command.push_back("__name:=" + program);
    command.insert(command.end(), more.begin(), more.end());
    nodes_[program + below] = std::make_unique<Child>(command);
  }
  // until a locus measurement: pressed, with the exciter on
  void shake() {
    AlignPegGoal goal;
    goal.strategy = "single_contact";
    align_.sendGoal(goal);
    ASSERT_TRUE(waitFor([this] {
      return plant_.last()->session != 0 && plant_.last()->exciter && simulator_.last()->exciter;
    }));
  }
  std::string endOfAlign() {
    EXPECT_TRUE(waitFor([this] { return align_.getState().isDone(); }, 120.0));
    EXPECT_EQ(align_.getState().state_, SimpleClientGoalState::ABORTED);
    return align_.getResult()->report.reason;
  }
  // the next goal, from the present pose of the peg
  void pressAgain() {
    MoveToContactGoal goal;
    goal.force = 8.0;
    press_.sendGoal(goal);
    ASSERT_TRUE(waitFor([this] { return press_.getState().isDone(); }, 120.0));
    ASSERT_EQ(press_.getState().state_, SimpleClientGoalState::SUCCEEDED)
        << press_.getResult()->message;
    // an arm on a busy machine arrives late
    const auto force = [this] { return test::liftingForce(*contacts_.last()); };
    const std::size_t n = contacts_.size();
    ASSERT_TRUE(waitFor([&] { return contacts_.size() > n + 2; }));
    EXPECT_TRUE(waitFor([&] { return std::abs(force() - 8.0) < 0.1 * 8.0; })) << force();
  }
  // largest motion of a joint over so many states [rad]
  double jointMotion(std::size_t states) {
    const std::size_t n = joints_.size();
    EXPECT_TRUE(waitFor([&] { return joints_.size() >= n + states; }));
    const auto all = joints_.all();
    double largest = 0.0;
    for (std::size_t i = n; i < all.size(); ++i) {
      for (std::size_t k = 0; k < all[i]->position.size(); ++k) {
        largest = std::max(largest, std::abs(all[i]->position[k] - all[n]->position[k]));
      }
    }
    return largest;
  }

  ros::NodeHandle nh_{"/arm_faults"};
  std::map<std::string, std::unique_ptr<Child>> nodes_;
  Record<PlantState> plant_{nh_, "plant_state"};
  Record<PlantState> simulator_{nh_, "arm/plant_state"};
  Record<Exciter> exciter_{nh_, "arm/exciter"};
  Record<Lease> leases_{nh_, "arm/lease"};
  Record<SupervisorState> state_{nh_, "assembly_supervisor/state"};
  Record<sensor_msgs::JointState> joints_{nh_, "arm/joint_states"};
  Record<ContactArray> contacts_{nh_, "truth/contacts"};
  actionlib::SimpleActionClient<AlignPegAction> align_{nh_, "align", false};
  actionlib::SimpleActionClient<MoveToContactAction> press_{nh_, "move_to_contact", false};
};

// The arm stays at the last point, the exciter is switched off, the supervisor names the bridge; a
// bridge restarted alone starts at the arm's pose.
TEST_F(ArmFaults, ABridgeThatDiesLeavesAnArmThatStandsAndAnotherOneGoesOn) {
  ASSERT_NO_FATAL_FAILURE(shake());
  const std::uint32_t boot_id = plant_.last()->life;
  nodes_.at("arm_bridge")->signal(SIGKILL);
  const auto off = [this] { return simulator_.last()->held && !simulator_.last()->exciter; };
  ASSERT_TRUE(waitFor(off));
  EXPECT_EQ(simulator_.last()->reason.rfind("expired", 0), 0U) << simulator_.last()->reason;
  EXPECT_LE((simulator_.last()->header.stamp - leases_.last()->header.stamp).toSec(),
            kTimeout + kBlock);
  EXPECT_LT(jointMotion(200), 1e-5);
  const std::string reason = endOfAlign();
  EXPECT_NE(reason.find("carrier_pose of /arm_faults/arm_bridge (gone)"), std::string::npos)
      << reason;
  EXPECT_TRUE(waitFor([this] { return state_.last()->in_contact; }));
  start("arm_bridge");
  ASSERT_TRUE(waitFor([&] { return plant_.last()->life != boot_id; }));
  // nothing moves by itself
  EXPECT_LT(jointMotion(200), 1e-5);
  EXPECT_FALSE(simulator_.last()->exciter);
  pressAgain();
}

TEST_F(ArmFaults, ARestartedBridgeEndsTheGoalByName) {
  ASSERT_NO_FATAL_FAILURE(shake());
  nodes_.at("arm_bridge")->signal(SIGKILL);
  exciter_.clear();
  start("arm_bridge");
  const std::string reason = endOfAlign();
  const bool named = reason.find("the plant was ") != std::string::npos ||
                     reason.find("arm_bridge") != std::string::npos;
  EXPECT_TRUE(named) << reason;
  ASSERT_TRUE(waitFor([this] { return !simulator_.last()->exciter; }));
  pressAgain();
  // the supervisor's last exciter command was still latched when the new bridge started
  for (const auto& exciter : exciter_.all()) EXPECT_FALSE(exciter->on);
}

// The goal ends before its clock has started.
TEST_F(ArmFaults, AGoalOnAStoppedArmHasTakenNoTime) {
  std_srvs::Trigger stop;
  ASSERT_TRUE(callService("/arm_faults/arm_bridge/stop", stop));
  AlignPegGoal goal;
  goal.strategy = "touch";
  align_.sendGoal(goal);
  EXPECT_NE(endOfAlign(), "");
  const AlignmentReport report = align_.getResult()->report;
  EXPECT_GE(report.simulated_time, 0.0) << report.reason;
  EXPECT_LT(report.simulated_time, 10.0) << report.reason;
  EXPECT_EQ(report.contacts, 0U);
}

TEST_F(ArmFaults, AnArmThatFallsSilentIsNamedAndTheNextGoalWorks) {
  ASSERT_NO_FATAL_FAILURE(shake());
  nodes_.at("emulate_arm")->signal(SIGKILL);
  const std::string reason = endOfAlign();
  EXPECT_NE(reason.find("no_state: no fresh state of the arm"), std::string::npos) << reason;
  ASSERT_TRUE(waitFor([this] { return !simulator_.last()->exciter && !plant_.last()->exciter; }));
  const std::size_t n = joints_.size();
  start("emulate_arm");
  ASSERT_TRUE(waitFor([&] { return joints_.size() > n + 100; }));
  pressAgain();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::arm_faults_test
