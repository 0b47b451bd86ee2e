// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/server/simple_action_server.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/SetBool.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/simulation/report_program.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge::report_test {
namespace {

using test::Child;
using test::executable;
using test::waitFor;

// radii of urdf/cell.urdf
constexpr double kPeg = 0.025, kHole = 0.0251;

Pose tilted(double about_y, const Eigen::Vector3d& p) {
  return {rotationFromVector({Eigen::Vector3d(0.0, about_y, 0.0)}), p};
}

// plays supervisor and simulator
class Report : public ::testing::Test {
 protected:
  Report()
      : server_(
            nh_, "align", [this](const AlignPegGoalConstPtr& goal) { execute(*goal); }, false) {
    pause_ = nh_.advertiseService<std_srvs::SetBool::Request, std_srvs::SetBool::Response>(
        "peg_hole_simulator/pause", [this](auto& request, auto& response) {
          running_ = !request.data;
          response.success = true;
          return true;
        });
    server_.start();
  }

  void publishTruth(const Pose& X_HP) {
    geometry_msgs::PoseStamped truth;
    truth.header.frame_id = "hole_truth";
    truth.header.stamp = ros::Time(stamp_ += 1.0);
    truth.pose = toPose(X_HP);
    if (!truth_pub_) {
      truth_pub_ = nh_.advertise<geometry_msgs::PoseStamped>("truth/pose", 10, true);
    }
    truth_pub_.publish(truth);
  }

  void execute(const AlignPegGoal& goal) {
    strategy_ = goal.strategy;
    // the clock starts after the goal
    EXPECT_TRUE(waitFor([this] { return running_.load(); }));
    AlignPegResult result;
    result.report.success = succeeds_;
    result.report.reason = succeeds_ ? "aligned" : "no_contact: none";
    result.report.header.stamp = ros::Time(stamp_ + 1.0);
    result.report.estimate_known = true;
    result.report.estimated_offset = {-0.0019, 0.0};
    result.report.estimated_tilt = {0.0, 0.02};
    result.report.estimated_pose.orientation.w = 1.0;
    result.report.contacts = 7;
    result.report.simulated_time = time_;
    result.report.wall_time = 1.25;
    if (truth_pub_) publishTruth(end_);
    if (succeeds_) {
      server_.setSucceeded(result);
    } else {
      server_.setAborted(result);
    }
  }

  int report(const std::vector<std::string>& arguments = {}) {
    ros::param::del("/report");
    file_ = test::temporaryFile("report.yaml");
    unlink(file_.c_str());
    std::vector<std::string> command = {executable("report"), "_report_file:=" + file_};
    command.insert(command.end(), arguments.begin(), arguments.end());
    Child child(command);
    const int code = child.wait();
    output_ = child.output();
    yaml_ = access(file_.c_str(), R_OK) == 0 ? YAML::LoadFile(file_) : YAML::Node();
    unlink(file_.c_str());
    return code;
  }

  ros::NodeHandle nh_;
  std::atomic<bool> running_{false};
  bool succeeds_ = true;
  double time_ = 12.5;
  Pose end_;
  double stamp_ = 1.0;
  std::string strategy_, file_, output_;
  YAML::Node yaml_;
  ros::Publisher truth_pub_;
  ros::ServiceServer pause_;
  actionlib::SimpleActionServer<AlignPegAction> server_;
};

TEST_F(Report, PrintsTrueAgainstEstimatedAndEndsZero) {
  publishTruth(tilted(0.02, Eigen::Vector3d(0.002, 0.0, 0.003)));
  EXPECT_EQ(report(), 0) << output_;
  EXPECT_EQ(strategy_, "auto");
  EXPECT_NE(output_.find("aligned"), std::string::npos) << output_;
  EXPECT_NE(output_.find("-1.900"), std::string::npos) << output_;
  EXPECT_NE(output_.find("-2.000"), std::string::npos) << output_;
  EXPECT_NE(output_.find("0.100"), std::string::npos) << output_;
  EXPECT_NE(output_.find("10.0 times real time"), std::string::npos) << output_;
  EXPECT_TRUE(yaml_["success"].as<bool>());
  EXPECT_TRUE(yaml_["verdict"].as<bool>());
  EXPECT_NEAR(yaml_["true_offset"][0].as<double>(), -0.002, 1e-15);
  EXPECT_NEAR(yaml_["true_tilt"][1].as<double>(), 0.02, 1e-12);
  EXPECT_EQ(yaml_["estimated_offset"][0].as<double>(), -0.0019);
  EXPECT_EQ(yaml_["contacts"].as<int>(), 7);
  EXPECT_EQ(yaml_["hole_radius"].as<double>(), kHole);
  EXPECT_EQ(yaml_["peg_radius"].as<double>(), kPeg);
}

TEST_F(Report, DoesNotBelieveASupervisorThatTheTruthContradicts) {
  publishTruth(Pose{});
  end_.p.x() = 2.0 * (kHole - kPeg);
  EXPECT_EQ(report(), 1) << output_;
  EXPECT_NE(output_.find("NOT inside"), std::string::npos) << output_;
  EXPECT_TRUE(yaml_["success"].as<bool>());
  EXPECT_FALSE(yaml_["verdict"].as<bool>());
}

// The edge is evaluated in the true bore, and the drawn model errors are in the report.
TEST_F(Report, EvaluatesInTheTrueBore) {
  ros::Publisher drawn_pub = nh_.advertise<std_msgs::String>("truth/mismatch", 1, true);
  std_msgs::String drawn;
  // a bore that leans by 5 mrad along x, 30 mm below the face
  drawn.data = "{hole: {bore_tilt: [0.0, 0.005]}}";
  drawn_pub.publish(drawn);
  publishTruth(Pose{});
  end_.p = Eigen::Vector3d(-0.03 * std::tan(0.005), 0.0, -0.03);
  EXPECT_EQ(report(), 0) << output_;
  EXPECT_NEAR(yaml_["edge_reach"].as<double>(), kPeg, 1e-9);
  EXPECT_EQ(yaml_["mismatch"]["hole"]["bore_tilt"][1].as<double>(), 0.005);
  end_.p.x() = 0.0;
  EXPECT_EQ(report(), 1) << output_;
}

TEST_F(Report, EndsOneWhenTheSupervisorFails) {
  succeeds_ = false;
  publishTruth(Pose{});
  EXPECT_EQ(report(), 1) << output_;
  EXPECT_NE(output_.find("not aligned: no_contact: none"), std::string::npos) << output_;
  EXPECT_EQ(yaml_["reason"].as<std::string>(), "no_contact: none");
}

TEST_F(Report, ARefusedGoalIsOneLine) {
  succeeds_ = false;
  time_ = 0.0;
  publishTruth(Pose{});
  EXPECT_EQ(report(), 1) << output_;
  EXPECT_NE(output_.find("not aligned: no_contact: none"), std::string::npos) << output_;
  EXPECT_EQ(output_.find("at the start"), std::string::npos) << output_;
}

TEST_F(Report, DoesWithoutTheTruth) {
  EXPECT_EQ(report({"_strategy:=double_contact"}), 0) << output_;
  EXPECT_EQ(strategy_, "double_contact");
  EXPECT_FALSE(yaml_["truth_known"].as<bool>());
  EXPECT_TRUE(yaml_["true_offset"].IsNull());
}

TEST_F(Report, BadParametersEndTwo) {
  EXPECT_EQ(report({"_timeout:=-1.0"}), 2) << output_;
  EXPECT_NE(output_.find("/report/timeout is -1"), std::string::npos) << output_;
  EXPECT_EQ(report({"_stratgy:=x"}), 2) << output_;
  EXPECT_NE(output_.find("/report/stratgy is unknown"), std::string::npos) << output_;
  for (const std::string depth : {"40", "-0.01", "deep"}) {
    EXPECT_EQ(report({"_insert:=" + depth}), 2) << output_;
    const std::string said = "insert: value " + depth + ": give a depth of 0 to 1 m, or floor";
    EXPECT_NE(output_.find(said), std::string::npos) << output_;
  }
}

// Without its underscore a parameter renames a topic that does not exist.
TEST_F(Report, AParameterWithoutItsUnderscoreIsNamed) {
  for (const std::string given : {"strategy:=touch", "~strategy:=touch", "insert:=floor",
                                  "report_file:=/tmp/report.yaml", "unpause:=false"}) {
    EXPECT_EQ(report({given}), 2) << output_;
    const std::string meant = "has an underscore before it, _" + given.substr(given.find('~') + 1);
    EXPECT_NE(output_.find(meant), std::string::npos) << output_;
  }
  EXPECT_EQ(strategy_, "");
  // what is no parameter is a topic
  EXPECT_EQ(report({"elsewhere:=touch"}), 0) << output_;
}

// A real cell has no simulator to wait for; the parameters of one that is still starting are there.
TEST_F(Report, WaitsForASimulatorThatBelongsToTheCellAlone) {
  pause_.shutdown();
  running_ = true;
  EXPECT_EQ(report({}), 0) << output_;
  nh_.setParam("peg_hole_simulator/scenario", "cell.yaml");
  EXPECT_EQ(report({"_start_timeout:=8"}), 1) << output_;
  EXPECT_NE(output_.find("is the simulator running?"), std::string::npos) << output_;
  nh_.deleteParam("peg_hole_simulator");
}

TEST_F(Report, EndsOneWhenAFileCannotBeWritten) {
  EXPECT_EQ(report({"_report_file:=/nowhere/report.yaml"}), 1) << output_;
  EXPECT_NE(output_.find("/nowhere/report.yaml"), std::string::npos) << output_;
}

// A disk that is full, and a limit of the size of files.
TEST_F(Report, EndsOneWhenItCannotPrintOrReachesAFileSizeLimit) {
  Child full({"/bin/sh", "-c", "exec " + executable("report") + " >/dev/full"});
  EXPECT_EQ(full.wait(), 1) << full.output();
  EXPECT_EQ(full.lines("report: can't write to standard output").size(), 1U) << full.output();
  const std::string file = test::temporaryFile("limited.yaml");
  Child limited(
      {"/bin/sh", "-c", "ulimit -f 0; exec " + executable("report") + " _report_file:=" + file});
  EXPECT_EQ(limited.wait(), 1) << limited.output();
  EXPECT_EQ(limited.lines("limited.yaml' can't be written (write: File too large)").size(), 1U)
      << limited.output();
}

TEST(ReportAlone, EndsOneWithoutMasterOrSupervisor) {
  Child orphan({executable("report")}, {"ROS_MASTER_URI=http://localhost:1"});
  EXPECT_EQ(orphan.wait(), 1) << orphan.output();
  EXPECT_EQ(orphan.lines("no ROS master").size(), 1U) << orphan.output();
  Child without_master({executable("report"), "_strategy:=touch"},
                       {"ROS_MASTER_URI=http://localhost:1"});
  EXPECT_EQ(without_master.wait(), 1) << without_master.output();
  EXPECT_EQ(without_master.lines("no ROS master").size(), 1U) << without_master.output();
  ros::param::del("/report");
  Child alone({executable("report"), "_start_timeout:=0.5"});
  EXPECT_EQ(alone.wait(), 1) << alone.output();
  EXPECT_EQ(alone.lines("is the supervisor running?").size(), 1U) << alone.output();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::report_test
