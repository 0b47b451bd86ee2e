// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "contact_force.h"
#include "live_client.h"

namespace assembly_cell::ros_bridge::assembly_supervisor_test {
namespace {

using actionlib::SimpleClientGoalState;
using test::Child;
using test::executable;
using test::Record;
using test::sourceFile;
using test::waitFor;

class Supervisor : public ::testing::Test {
 protected:
  Supervisor()
      : command_(nh_, "carrier_command"),
        exciter_(nh_, "exciter"),
        carrier_(nh_, "carrier_pose"),
        contacts_(nh_, "truth/contacts"),
        report_(nh_, "report"),
        pose_(nh_, "truth/pose"),
        align_(nh_, "align", false),
        assemble_(nh_, "assemble", false),
        press_(nh_, "move_to_contact", false),
        retreat_(nh_, "retreat", false) {}

  void SetUp() override {
    ASSERT_TRUE(waitFor([this] {
      return align_.isServerConnected() && assemble_.isServerConnected() &&
             press_.isServerConnected() && retreat_.isServerConnected() && command_.connected() &&
             exciter_.connected() && carrier_.size() > 0 && contacts_.connected() &&
             report_.connected();
    })) << "the cell is not running";
    // the peg hangs over the plane again; the clock continues
    std_srvs::Trigger reset;
    ASSERT_TRUE(callService("peg_hole_simulator/reset", reset));
    ASSERT_TRUE(reset.response.success) << reset.response.message;
    command_.clear();
    exciter_.clear();
    report_.clear();
  }

  void startAlign(const std::string& strategy) {
    AlignPegGoal goal;
    goal.strategy = strategy;
    align_.sendGoal(goal, {}, {}, [this](const AlignPegFeedbackConstPtr& feedback) {
      std::lock_guard<std::mutex> lock(mutex_);
      feedback_.push_back(*feedback);
    });
  }
  SimpleClientGoalState assemble(double depth) {
    AssemblePegGoal goal;
    goal.depth = depth;
    assemble_.sendGoal(goal, {}, {}, [this](const AssemblePegFeedbackConstPtr& feedback) {
      std::lock_guard<std::mutex> lock(mutex_);
      deepest_ = std::max(deepest_, feedback->depth);
    });
    return finish(assemble_);
  }
  // until the peg is pressed with the exciter on
  bool shaking() {
    std::lock_guard<std::mutex> lock(mutex_);
    return !feedback_.empty() && exciter_.last() && exciter_.last()->on;
  }
  template <class Client>
  SimpleClientGoalState finish(Client& client) {
    EXPECT_TRUE(waitFor([&] { return client.getState().isDone(); })) << "the goal doesn't end";
    return client.getState();
  }
  SimpleClientGoalState press(double force) {
    MoveToContactGoal goal;
    goal.force = force;
    press_.sendGoal(goal, {}, {}, [this](const MoveToContactFeedbackConstPtr& feedback) {
      std::lock_guard<std::mutex> lock(mutex_);
      press_feedback_.push_back(*feedback);
    });
    return finish(press_);
  }

  ros::NodeHandle nh_;
  Record<geometry_msgs::PoseStamped> command_;
  Record<Exciter> exciter_;
  Record<geometry_msgs::PoseStamped> carrier_;
  Record<ContactArray> contacts_;
  Record<AlignmentReport> report_;
  Record<geometry_msgs::PoseStamped> pose_;
  actionlib::SimpleActionClient<AlignPegAction> align_;
  actionlib::SimpleActionClient<AssemblePegAction> assemble_;
  actionlib::SimpleActionClient<MoveToContactAction> press_;
  actionlib::SimpleActionClient<RetreatAction> retreat_;
  std::mutex mutex_;
  std::vector<AlignPegFeedback> feedback_;
  double deepest_ = 0.0;  // largest depth in the feedback of assemble [m]
  std::vector<MoveToContactFeedback> press_feedback_;
};

TEST_F(Supervisor, HoldsThePressForceWithinFivePercent) {
  const auto state = press(12.0);
  ASSERT_EQ(state.state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  EXPECT_TRUE(press_.getResult()->success);
  EXPECT_NEAR(press_.getResult()->force, 12.0, 0.05 * 12.0);
  EXPECT_GT(command_.size(), 0U);

  // the true contact force from here on, mean of 50 blocks
  const std::size_t n = contacts_.size();
  ASSERT_TRUE(waitFor([&] { return contacts_.size() >= n + 50; }));
  const auto all = contacts_.all();
  double sum = 0.0;
  for (std::size_t i = n; i < n + 50; ++i) {
    sum += test::liftingForce(*all[i]);
  }
  EXPECT_NEAR(sum / 50, 12.0, 0.05 * 12.0);
  std::lock_guard<std::mutex> lock(mutex_);
  ASSERT_FALSE(press_feedback_.empty());
  EXPECT_LT(press_feedback_.back().z, press_feedback_.front().z);
}

TEST_F(Supervisor, RefusesForcesBeyondItsLimits) {
  for (const double force : {-1.0, 0.0, 100.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(press(force).state_, SimpleClientGoalState::ABORTED);
    EXPECT_FALSE(press_.getResult()->success);
    const std::string given = std::isnan(force) ? "nan" : text("%g N", force);
    EXPECT_EQ(press_.getResult()->message, "force is " + given +
                                               ": give more than 0 and less than 38.1 N, "
                                               "~force_limit less ~press_tolerance");
  }
  // below the resolution of a press
  EXPECT_EQ(press(1e-3).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(press_.getResult()->message.rfind("force is 0.001 N: give at least 0.", 0), 0U)
      << press_.getResult()->message;
  EXPECT_EQ(command_.size(), 0U);
  EXPECT_EQ(press(0.75).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  EXPECT_EQ(press(37.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
}

// The reason of the previous goal is not published while a goal runs.
TEST_F(Supervisor, PublishesTheReasonOfTheLastGoal) {
  const Record<SupervisorState> states(nh_, "assembly_supervisor/state");
  const auto now = [&](const std::string& goal, const std::string& reason) {
    return waitFor([&] {
      const auto last = states.last();
      return last && last->goal == goal && last->reason.rfind(reason, 0) == 0;
    });
  };
  ASSERT_EQ(press(8.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  ASSERT_TRUE(now("", "move_to_contact presses with"));
  // a refused goal changes nothing
  startAlign("telepathy");
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  ASSERT_TRUE(now("", "move_to_contact presses with"));
  retreat_.sendGoal(RetreatGoal());
  EXPECT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED);
  ASSERT_TRUE(now("", "free"));
  EXPECT_FALSE(states.last()->in_contact);
  std::set<std::string> ran;
  for (const auto& state : states.all()) {
    ran.insert(state->goal);
    EXPECT_TRUE(state->goal.empty() || state->reason.empty()) << state->goal;
  }
  EXPECT_EQ(ran.count("retreat"), 1U);
  // also that of a failed goal whose peg is free again
  startAlign("single_contact");
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  align_.cancelGoal();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED);
  EXPECT_TRUE(now("", "cancelled"));
}

// A new limit is valid from the next goal on; the active goal keeps its limit.
TEST_F(Supervisor, AppliesAChangedForceLimitToTheNextGoal) {
  const std::string node = "assembly_supervisor";
  MoveToContactGoal goal;
  goal.force = 25.0;
  press_.sendGoal(goal, {}, {}, [this](const MoveToContactFeedbackConstPtr& feedback) {
    std::lock_guard<std::mutex> lock(mutex_);
    press_feedback_.push_back(*feedback);
  });
  ASSERT_TRUE(waitFor([&] {
    std::lock_guard<std::mutex> lock(mutex_);
    return !press_feedback_.empty();
  }));
  ASSERT_TRUE(test::setLive(node, "force_limit", 20.0));
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  EXPECT_NEAR(press_.getResult()->force, 25.0, 0.05 * 25.0);

  std_srvs::Trigger reset;
  ASSERT_TRUE(callService("peg_hole_simulator/reset", reset));
  EXPECT_EQ(press(25.0).state_, SimpleClientGoalState::ABORTED);
  EXPECT_NE(press_.getResult()->message.find("less than 19.05"), std::string::npos)
      << press_.getResult()->message;
  // a value that contradicts others, is not a number or needs a restart changes nothing
  EXPECT_FALSE(test::setLive(node, "force_limit", 14.0));  // contact_force is 15
  EXPECT_FALSE(test::setLive(node, "force_limit", std::nan("")));
  EXPECT_FALSE(test::setLive(node, "descent_limit", 0.5));
  EXPECT_EQ(press(20.5).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(press(19.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;

  // at most the value at the start
  dynamic_reconfigure::Config after;
  ASSERT_TRUE(test::setLive(node, "force_limit", 100.0, &after));
  EXPECT_EQ(test::valueIn(after, "force_limit"), 40.0);
  ASSERT_TRUE(callService("peg_hole_simulator/reset", reset));
  EXPECT_EQ(press(50.0).state_, SimpleClientGoalState::ABORTED);
  EXPECT_NE(press_.getResult()->message.find("less than 38.1"), std::string::npos);
  EXPECT_EQ(press(25.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
}

TEST_F(Supervisor, AssemblesToADepth) {
  const auto state = assemble(0.03);
  const AssemblePegResult result = *assemble_.getResult();
  ASSERT_EQ(state.state_, SimpleClientGoalState::SUCCEEDED) << result.report.reason;
  EXPECT_TRUE(result.report.success);
  EXPECT_GE(result.depth, 0.03);
  EXPECT_EQ(assemble_.getState().getText(), text("seated: %.2f mm deep", result.depth * 1e3));
  EXPECT_LT(result.force, 30.0);  // insertion.md, section 4
  EXPECT_GT(result.time, 1.0);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    EXPECT_GT(deepest_, 0.025);
  }
  // ground truth at the end of the last block that was used
  const auto seen = [&] {
    const auto last = pose_.last();
    return last && last->header.stamp >= result.report.header.stamp;
  };
  ASSERT_TRUE(waitFor(seen));
  EXPECT_NEAR(pose_.last()->pose.position.z, -result.depth, 2e-4);
}

// A peg in the hole is inserted further, and withdrawn by the next alignment.
TEST_F(Supervisor, ContinuesFromTheDepthOfTheLastGoal) {
  const auto height = [this](const ros::Time& stamp) {
    EXPECT_TRUE(waitFor([&] { return pose_.last() && pose_.last()->header.stamp >= stamp; }));
    return pose_.last()->pose.position.z;
  };
  for (const double depth : {0.02, 0.02, 0.03}) {
    const auto state = assemble(depth);
    const AssemblePegResult result = *assemble_.getResult();
    ASSERT_EQ(state.state_, SimpleClientGoalState::SUCCEEDED) << result.report.reason;
    EXPECT_NEAR(height(result.report.header.stamp), -depth, 3e-4);
  }
  // it is aligned and stays there
  startAlign("auto");
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::SUCCEEDED)
      << align_.getResult()->report.reason;
  EXPECT_EQ(assemble(0.01).state_, SimpleClientGoalState::ABORTED);
  const std::string reason = assemble_.getResult()->report.reason;
  EXPECT_NE(reason.find("deep already; retreat first"), std::string::npos) << reason;

  retreat_.sendGoal(RetreatGoal());
  ASSERT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
      << retreat_.getResult()->message;
  const auto out = [this] { return pose_.last()->pose.position.z > 1e-3; };
  EXPECT_TRUE(waitFor(out)) << pose_.last()->pose.position.z;

  EXPECT_EQ(assemble(0.01).state_, SimpleClientGoalState::SUCCEEDED)
      << assemble_.getResult()->report.reason;
  EXPECT_NEAR(height(assemble_.getResult()->report.header.stamp), -0.01, 3e-4);
}

TEST_F(Supervisor, RefusesADepthThatTheHoleDoesNotHave) {
  for (const double depth : {0.0, 0.06, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(assemble(depth).state_, SimpleClientGoalState::ABORTED);
    const std::string reason = assemble_.getResult()->report.reason;
    EXPECT_NE(reason.find("depth is"), std::string::npos) << reason;
  }
  EXPECT_EQ(command_.size(), 0U);
}

TEST_F(Supervisor, RefusesAnUnknownStrategyAndReportsIt) {
  startAlign("telepathy");
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  const AlignmentReport report = align_.getResult()->report;
  EXPECT_FALSE(report.success);
  EXPECT_NE(report.reason.find("telepathy"), std::string::npos) << report.reason;
  EXPECT_FALSE(report.truth_known);
  ASSERT_TRUE(waitFor([this] { return report_.last() != nullptr; }));
  EXPECT_EQ(report_.last()->reason, report.reason);
  // latched
  Record<AlignmentReport> late(nh_, "report");
  EXPECT_TRUE(waitFor([&] { return late.last() != nullptr; }));
}

TEST_F(Supervisor, CancelEndsAnAlignmentWithExciterOffAndCarrierAtRest) {
  startAlign("single_contact");
  const auto contacts = [this] {
    std::lock_guard<std::mutex> lock(mutex_);
    return feedback_.empty() ? 0U : feedback_.back().contacts;
  };
  const auto is_done = [this] { return align_.getState().isDone(); };
  ASSERT_TRUE(waitFor([&] { return is_done() || (contacts() > 0 && shaking()); }));
  ASSERT_FALSE(is_done()) << align_.getState().getText();
  align_.cancelGoal();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(align_.getResult()->report.reason, "cancelled");
  EXPECT_GE(align_.getResult()->report.contacts, contacts());
  EXPECT_GT(align_.getResult()->report.simulated_time, 0.0);
  EXPECT_FALSE(align_.getResult()->report.estimate_known);
  EXPECT_EQ(align_.getResult()->report.estimated_pose.position.x, 0.0);
  ASSERT_TRUE(waitFor([this] { return exciter_.last() && !exciter_.last()->on; }));

  // the commanded pose is the last one, and the carrier stays there
  ASSERT_TRUE(waitFor([this] { return command_.last() != nullptr; }));
  const std::size_t n = carrier_.size();
  ASSERT_TRUE(waitFor([&] { return carrier_.size() > n + 50; }));
  const auto all = carrier_.all();
  const auto& commanded = command_.last()->pose.position;
  for (std::size_t i = n + 25; i < n + 50; ++i) {
    EXPECT_NEAR(all[i]->pose.position.z, commanded.z, 1e-6);
    // the carrier's springs yield by less than 40 N over 2e5 N/m
    EXPECT_NEAR(all[i]->pose.position.x, commanded.x, 2e-4);
  }
}

TEST_F(Supervisor, AcceptsOneGoalAtATime) {
  startAlign("single_contact");
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  EXPECT_EQ(press(5.0).state_, SimpleClientGoalState::ABORTED);
  EXPECT_NE(press_.getResult()->message.find("busy"), std::string::npos);
  align_.cancelGoal();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED);
}

TEST_F(Supervisor, EndsAGoalWithoutSamples) {
  std_srvs::SetBool pause;
  pause.request.data = true;
  ASSERT_TRUE(callService("peg_hole_simulator/pause", pause));
  startAlign("single_contact");
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  EXPECT_NE(align_.getResult()->report.reason.find("no block of samples"), std::string::npos)
      << align_.getResult()->report.reason;
  pause.request.data = false;
  ASSERT_TRUE(callService("peg_hole_simulator/pause", pause));
  const std::size_t n = carrier_.size();
  EXPECT_TRUE(waitFor([&] { return carrier_.size() > n; })) << "the lockstep is broken";
}

TEST(SupervisorBadInput, IsRefusedInOneLine) {
  const std::string scenario = "_scenario:=" + sourceFile("config/scenarios/cell.yaml");
  const auto refuse = [](const std::vector<std::string>& arguments, const std::string& expected) {
    ros::param::del("/bad/assembly_supervisor");
    std::vector<std::string> command = {executable("assembly_supervisor"), "__ns:=/bad"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    Child child(command);
    EXPECT_EQ(child.wait(), 1) << child.output();
    EXPECT_EQ(child.lines("FATAL").size(), 1U) << child.output();
    EXPECT_EQ(child.lines(expected).size(), 1U) << expected << "\n" << child.output();
  };
  refuse({}, "/bad/assembly_supervisor/scenario is missing");
  refuse({scenario, "_press_force:=nan"}, "/bad/assembly_supervisor/press_force is nan");
  refuse({scenario, "_press_force:=50.0"}, "press_force: value 50");
  refuse({scenario, "_exciter_direction:=0"}, "exciter_direction: value 0");
  refuse({scenario, "_strategy:=telepathy"}, "telepathy");
  refuse({scenario, "_windw:=0.1"}, "/bad/assembly_supervisor/windw is unknown");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::assembly_supervisor_test
