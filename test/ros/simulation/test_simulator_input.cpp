// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "cell_fixture.h"
#include "temporary_folder.h"

// Bad input: one line, exit code 1.
namespace assembly_cell::ros_bridge::simulator_input_test {
namespace {

using test::Child;
using test::executable;
using test::sourceFile;

const double kNaN = std::numeric_limits<double>::quiet_NaN();

class SimulatorBadInput : public ::testing::Test {
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

TEST_F(SimulatorBadInput, Parameters) {
  refuse({}, "/bad/peg_hole_simulator/scenario is missing");
  ros::param::set("/bad/peg_hole_simulator/noise", kNaN);
  refuse({scenario_}, "/bad/peg_hole_simulator/noise is nan");
  ros::param::del("/bad/peg_hole_simulator/noise");
  refuse({scenario_, "_noize:=0.1"}, "/bad/peg_hole_simulator/noize is unknown");
  ros::param::del("/bad/peg_hole_simulator/noize");
  refuse({scenario_, "_seed:=many"}, "/bad/peg_hole_simulator/seed is");
  ros::param::del("/bad/peg_hole_simulator/seed");
  refuse({scenario_, "_bits:=12"},
         "parameter /bad/peg_hole_simulator/bits is 12: give 10, 16 or 24");
}

TEST_F(SimulatorBadInput, Scenario) {
  refuse({"_scenario:=/nowhere.yaml"}, "/nowhere.yaml");
  refuse({scenario_, "_overrides:=peg.mass=.nan"}, "peg.mass");
  refuse({scenario_, "_overrides:=peg.colour=red"}, "colour");
}

TEST_F(SimulatorBadInput, Mismatch) {
  refuse({scenario_, "_mismatch:=/nowhere.yaml"}, "/nowhere.yaml");
  const std::string file = test::temporaryFile("mismatch.yaml");
  std::ofstream(file) << "scale: {peg.mass: heavy}\n";
  refuse({scenario_, "_mismatch:=" + file}, "scale.peg.mass: value heavy");
  unlink(file.c_str());
}

// The ground truth that a mismatch draws is published once, to subscribers with access; the
// carrier's pose is that of its encoders.
TEST_F(SimulatorBadInput, GoodMismatchIsPublishedWithTheTruth) {
  const std::string file = test::temporaryFile("mismatch.yaml");
  std::ofstream(file) << "hole: {bore_tilt: 0.002}\ncarrier: {frame: {offset: 0.05}}\n";
  ros::param::set("/bad/peg_hole_simulator/participants", std::vector<std::string>{"absent"});
  Child child({executable("peg_hole_simulator"), "__ns:=/bad", "/clock:=clock", "/tf:=tf",
               "/tf_static:=tf_static", "_lockstep:=true", "_mismatch:=" + file, "_seed:=4",
               scenario_});
  ros::NodeHandle nh;
  const auto drawn =
      ros::topic::waitForMessage<std_msgs::String>("/bad/truth/mismatch", nh, ros::Duration(60.0));
  const auto pose = ros::topic::waitForMessage<geometry_msgs::PoseStamped>("/bad/carrier_pose", nh,
                                                                           ros::Duration(60.0));
  ASSERT_TRUE(drawn && pose) << child.output();
  const YAML::Node truth = YAML::Load(drawn->data);
  EXPECT_NEAR(std::hypot(truth["hole"]["bore_tilt"][0].as<double>(),
                         truth["hole"]["bore_tilt"][1].as<double>()),
              0.002, 1e-15);
  // the start lies at minus the offset, the carrier's deflection under the weight aside
  const YAML::Node offset = truth["carrier"]["frame"]["offset"];
  EXPECT_NEAR(pose->pose.position.x, -offset[0].as<double>(), 1e-4);
  EXPECT_NEAR(pose->pose.position.y, -offset[1].as<double>(), 1e-4);
  EXPECT_NEAR(pose->pose.position.z, -offset[2].as<double>(), 1e-4);
  ros::param::del("/bad/peg_hole_simulator");
  unlink(file.c_str());
}

TEST_F(SimulatorBadInput, RobotDescription) {
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

TEST_F(SimulatorBadInput, NoMaster) {
  Child child({executable("peg_hole_simulator")}, {"ROS_MASTER_URI=http://localhost:1"});
  EXPECT_EQ(child.wait(), 1) << child.output();
  EXPECT_EQ(child.lines("no ROS master").size(), 1U) << child.output();
}

TEST_F(SimulatorBadInput, MissingParticipantEndsTheNode) {
  ros::param::set("/bad/peg_hole_simulator/participants", std::vector<std::string>{"absent"});
  Child child({executable("peg_hole_simulator"), "__ns:=/bad", "/clock:=clock", "/tf:=tf",
               "/tf_static:=tf_static", "_lockstep:=true", "_start_timeout:=0.5", scenario_});
  EXPECT_EQ(child.wait(), 1) << child.output();
  EXPECT_EQ(child.lines("absent (never answered)").size(), 1U) << child.output();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::simulator_input_test
