// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/ros/supervision/plant_link.h"
#include "cell_run.h"

// The nodes of a cell in one process.
namespace assembly_cell::ros_bridge::nodelets_test {
namespace {

using test::CellRun;
using test::Child;
using test::executable;
using test::runCell;
using test::waitFor;
using test::without;

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> with(std::vector<std::string> arguments, const std::string& argument) {
  arguments.push_back(argument);
  return arguments;
}

// Registered nodes, without the test's own and those of ROS.
std::vector<std::string> cellNodes() {
  std::vector<std::string> nodes;
  EXPECT_TRUE(ros::master::getNodes(nodes));
  const auto other = [](const std::string& node) {
    return node == ros::this_node::getName() || node == "/rosout" ||
           node == "/robot_state_publisher" || node.rfind("/report", 0) == 0;
  };
  nodes.erase(std::remove_if(nodes.begin(), nodes.end(), other), nodes.end());
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

void expectSameResults(const std::vector<std::string>& arguments, const std::string& strategy) {
  std::vector<std::string> nodes;
  const CellRun one =
      runCell(with(arguments, "nodelets:=true"), strategy, [&] { nodes = cellNodes(); });
  ASSERT_EQ(one.exit_code, 0) << one.output;
  EXPECT_EQ(nodes, std::vector<std::string>{"/cell"});
  EXPECT_GT(one.commands.size(), 100U);
  EXPECT_EQ(one.in_base.count("hole_estimated"), 1U);
  EXPECT_EQ(one.in_base.count("hole_truth"), 1U);

  const CellRun separate =
      runCell(with(arguments, "nodelets:=false"), strategy, [&] { nodes = cellNodes(); });
  ASSERT_EQ(separate.exit_code, 0) << separate.output;
  EXPECT_GT(nodes.size(), 5U);
  EXPECT_EQ(without(one.report, {}), without(separate.report, {}));
  EXPECT_TRUE(one.commands == separate.commands)
      << one.commands.size() << " and " << separate.commands.size() << " commands";
}

TEST(Nodelets, OneProcessHasTheSameResultsToTheLastBit) { expectSameResults({}, "single_contact"); }

TEST(Nodelets, AlsoWithTheTwinForceEstimator) {
  expectSameResults({"twin_force:=true", "seed:=2"}, "twin_force");
}

TEST(Nodelets, AlsoInBlocksOfTwoMilliseconds) {
  expectSameResults({"block_size:=10", "seed:=3"}, "single_contact");
}

TEST(Nodelets, AlsoThroughAnArm) { expectSameResults({"arm:=true", "seed:=4"}, "twin_force"); }

// ---- nodes of one process, which share its name ----

Ack answerOf(const std::string& node, std::uint32_t commands, std::uint32_t session) {
  Ack ack;
  ack.node = node;
  ack.sequence = 1;
  ack.commands = commands;
  ack.session = session;
  return ack;
}

TEST(SharedProcess, WaitsForTheCommandsOfAllParticipants) {
  Participants participants({"one", "other"});
  participants.expect(1);
  EXPECT_EQ(participants.answer(answerOf("one", 1, 7), "/cell"), "");
  EXPECT_EQ(participants.answer(answerOf("other", 1, 0), "/cell"), "");
  std_msgs::Header header;
  EXPECT_TRUE(participants.count("/cell", "carrier_command", header));
  EXPECT_FALSE(participants.allAnswered(1)) << "one of two commands";
  EXPECT_EQ(participants.missing(1), "one (commands lost), other (commands lost)");
  EXPECT_FALSE(participants.count("/cell", "carrier_command", header)) << "the same again";
  EXPECT_TRUE(participants.count("/cell", "exciter", header));
  EXPECT_TRUE(participants.allAnswered(1));
}

TEST(SharedProcess, AParticipantWithoutASessionEndsNone) {
  Participants participants({"supervisor", "driver"});
  EXPECT_TRUE(participants.reportsSession(answerOf("supervisor", 0, 7)));
  EXPECT_FALSE(participants.reportsSession(answerOf("driver", 0, 0)));
  EXPECT_TRUE(participants.reportsSession(answerOf("supervisor", 0, 0))) << "released";
  EXPECT_FALSE(participants.reportsSession(answerOf("supervisor", 0, 0)));
}

TEST(SharedProcess, OnlyOneOfItsNodesOwnsThePlant) {
  ros::NodeHandle nh("one_name"), elsewhere("another_cell");
  PlantLink one(nh, "/one", false, [] {}), other(nh, "/other", false, [] {});
  PlantLink there(elsewhere, "/third", false, [] {});
  one.acquire();
  other.acquire();
  EXPECT_NE(one.status().session, 0U);
  EXPECT_EQ(one.status().fault, "");
  EXPECT_EQ(other.status().session, 0U);
  EXPECT_EQ(other.status().fault, "/one holds the plant");
  there.acquire();
  EXPECT_EQ(there.status().fault, "") << "another plant";
  // a node that is no owner releases nothing
  other.release();
  other.acquire();
  EXPECT_NE(other.status().fault, "");
  other.release();
  one.release();
  other.acquire();
  EXPECT_EQ(other.status().fault, "");
}

// The publisher of the carrier's pose is the plant, however long it is silent.
TEST(PlantLink, RefusesAStateOfAnotherNodeThanThePlant) {
  ros::NodeHandle nh("own_state");
  ros::Publisher plant = nh.advertise<PlantState>("plant_state", 1, true);
  std::atomic<int> changes{0};
  PlantLink link(nh, "/one", true, [&] { ++changes; });
  PlantState state;
  state.holder = "/owner";
  plant.publish(state);
  ASSERT_TRUE(waitFor([&] { return changes > 0; }));
  // a state from before the plant's node is known is dropped
  link.setPlantNode("/the_plant");
  link.acquire();
  EXPECT_EQ(link.status().fault, "");
  link.release();
  const auto refused = [] { return IncomingLog::ofThisProcess().figures(); };
  const std::uint64_t before = refused().refused;
  plant.publish(state);
  ASSERT_TRUE(waitFor([&] { return refused().refused > before; }));
  EXPECT_EQ(refused().last, "plant_state of " + ros::this_node::getName() +
                                ": the plant is /the_plant, which publishes carrier_pose: end the "
                                "other publisher");
  EXPECT_EQ(changes, 1);
  link.setPlantNode(ros::this_node::getName());
  plant.publish(state);
  ASSERT_TRUE(waitFor([&] { return changes > 1; }));
  link.acquire();
  EXPECT_EQ(link.status().fault, "/owner holds the plant");
}

TEST(PlantLink, TakesNoPlantOfAnotherProcess) {
  ros::NodeHandle nh("held_cell");
  ros::Publisher plant = nh.advertise<PlantState>("plant_state", 1, true);
  std::atomic<int> changes{0};
  PlantLink link(nh, "/one", true, [&] { ++changes; });
  PlantState state;
  state.life = 1;
  state.session = 5;
  state.holder = "/owner";
  plant.publish(state);
  ASSERT_TRUE(waitFor([&] { return changes > 0; }));
  link.acquire();
  EXPECT_EQ(link.status().session, 0U);
  EXPECT_EQ(link.status().fault, "/owner holds the plant");
  link.release();
  state.session = 0;
  state.holder.clear();
  plant.publish(state);
  ASSERT_TRUE(waitFor([&] { return changes > 1; }));
  link.acquire();
  EXPECT_NE(link.status().session, 0U);
  EXPECT_EQ(link.status().fault, "");
}

// ---- end of the process ----

// The launch reports a bad parameter in this line and ends.
void expectRefusal(const std::vector<std::string>& arguments, const std::string& line) {
  std::vector<std::string> command = {test::sourceFile("scripts/launch"), "assembly_cell",
                                      "cell.launch", "lockstep:=true"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  for (const std::string nodelets : {"nodelets:=true", "nodelets:=false"}) {
    Child launch(with(command, nodelets));
    EXPECT_EQ(launch.wait(), 1) << launch.output();
    EXPECT_EQ(launch.lines(line).size(), 1U) << launch.output();
  }
}

TEST(Nodelets, ABadParameterEndsTheCellWithOneLine) {
  const std::string remedy = ": give a whole number from 5 to 100";
  expectRefusal({"block_size:=4"}, "parameter /peg_hole_simulator/block_size is 4" + remedy);
  expectRefusal({"block_size:=101"}, "parameter /peg_hole_simulator/block_size is 101" + remedy);
  expectRefusal({"strategy:=guess"}, "strategy is \"guess\": give one of");
}

TEST(Nodelets, TheProcessEndsWithASimulatorThatTimesOut) {
  ros::NodeHandle nh;
  nh.setParam("robot_description", textOf(test::sourceFile("urdf/cell.urdf")));
  nh.setParam("alone/scenario", test::sourceFile("config/scenarios/cell.yaml"));
  nh.setParam("alone/lockstep", true);
  nh.setParam("alone/participants", std::vector<std::string>{"missing"});
  nh.setParam("alone/start_timeout", 0.5);
  Child process({executable("nodelet_manager"), "__name:=manager",
                 "_nodelets:=assembly_cell/peg_hole_simulator alone"});
  EXPECT_EQ(process.wait(), 1) << process.output();
  EXPECT_EQ(process.lines("no answer to block 0 within 0.5 s of wall time from missing").size(), 1U)
      << process.output();
}

TEST(Nodelets, NamesABadNodelet) {
  for (const auto& [nodelets, line] : std::vector<std::pair<std::string, std::string>>{
           {"assembly_cell/locus_estimator",
            "parameter /manager/nodelets: 'assembly_cell/locus_estimator' is no nodelet: give TYPE "
            "NAME [FROM:=TO ...]"},
           {"assembly_cell/missing missing", "missing: nodelet assembly_cell/missing: "}}) {
    Child process({executable("nodelet_manager"), "__name:=manager", "_nodelets:=" + nodelets});
    EXPECT_EQ(process.wait(), 1) << process.output();
    EXPECT_EQ(process.lines(line).size(), 1U) << process.output();
  }
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::nodelets_test
