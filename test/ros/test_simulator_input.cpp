// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <limits>
#include <string>
#include <vector>

#include "cell_fixture.h"

// Bad input: one line, exit code 1.
namespace assembly_cell::ros_bridge {
namespace {

using test::Child;
using test::executable;
using test::sourceFile;

const double kNaN = std::numeric_limits<double>::quiet_NaN();

class BadInput : public ::testing::Test {
 protected:
  // what the node says, in one line; `expected` must be part of it
  void refuse(const std::vector<std::string>& arguments, const std::string& expected) {
    std::vector<std::string> command = {executable("peg_hole_simulator"), "__ns:=/bad"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    Child child(command);
    EXPECT_EQ(child.wait(), 1) << child.output();
    EXPECT_EQ(child.lines("FATAL").size(), 1U) << child.output();
    EXPECT_EQ(child.lines(expected).size(), 1U) << expected << "\n" << child.output();
  }
  void SetUp() override {
    std::string description;
    ASSERT_TRUE(ros::param::get("/robot_description", description));
    ros::param::set("/bad/robot_description", description);
    ros::param::del("/bad/peg_hole_simulator");
  }
  const std::string scenario_ = "_scenario:=" + sourceFile("config/scenarios/cell.yaml");
};

TEST_F(BadInput, Parameters) {
  refuse({}, "/bad/peg_hole_simulator/scenario is missing");
  ros::param::set("/bad/peg_hole_simulator/noise", kNaN);
  refuse({scenario_}, "/bad/peg_hole_simulator/noise is nan");
  ros::param::del("/bad/peg_hole_simulator/noise");
  refuse({scenario_, "_noize:=0.1"}, "/bad/peg_hole_simulator/noize is unknown");
  ros::param::del("/bad/peg_hole_simulator/noize");
  refuse({scenario_, "_seed:=many"}, "/bad/peg_hole_simulator/seed is");
  ros::param::del("/bad/peg_hole_simulator/seed");
  refuse({scenario_, "_bits:=12"}, "bits");
}

TEST_F(BadInput, Scenario) {
  refuse({"_scenario:=/nowhere.yaml"}, "/nowhere.yaml");
  refuse({scenario_, "_overrides:=peg.mass=.nan"}, "peg.mass");
  refuse({scenario_, "_overrides:=peg.colour=red"}, "colour");
}

TEST_F(BadInput, RobotDescription) {
  refuse({scenario_, "_overrides:=peg.radius=0.024"}, "0.024");
  std::string description;
  ros::param::get("/bad/robot_description", description);
  // a field less
  const std::size_t at = description.find("<mass");
  ASSERT_NE(at, std::string::npos);
  std::string broken = description;
  broken.erase(at, description.find("/>", at) + 2 - at);
  ros::param::set("/bad/robot_description", broken);
  ros::param::del("/bad/peg_hole_simulator");
  refuse({scenario_}, "mass");
  ros::param::del("/bad/robot_description");
  refuse({scenario_}, "/bad/robot_description is missing");
}

TEST_F(BadInput, NoMaster) {
  Child child({executable("peg_hole_simulator")}, {"ROS_MASTER_URI=http://localhost:1"});
  EXPECT_EQ(child.wait(), 1) << child.output();
  EXPECT_EQ(child.lines("no ROS master").size(), 1U) << child.output();
}

TEST_F(BadInput, MissingParticipantEndsTheNode) {
  ros::param::set("/bad/peg_hole_simulator/participants", std::vector<std::string>{"nobody"});
  Child child({executable("peg_hole_simulator"), "__ns:=/bad", "/clock:=clock", "/tf:=tf",
               "/tf_static:=tf_static", "_lockstep:=true", "_start_timeout:=0.5", scenario_});
  EXPECT_EQ(child.wait(), 1) << child.output();
  EXPECT_EQ(child.lines("nobody (never answered)").size(), 1U) << child.output();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge

int main(int argc, char** argv) {
  ros::init(argc, argv, "simulator_input_test");
  ::testing::InitGoogleTest(&argc, argv);
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
