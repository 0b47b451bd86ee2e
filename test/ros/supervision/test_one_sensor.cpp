// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>
#include <string>
#include <vector>

#include "assembly_cell/ros/supervision/block_assembly.h"
#include "cell_run.h"

// A cell with sensor_b alone.
namespace assembly_cell::ros_bridge::one_sensor_test {
namespace {

using test::CellRun;
using test::runCell;

bool isThere(const std::vector<std::string>& nodes, const std::string& node) {
  return std::find(nodes.begin(), nodes.end(), node) != nodes.end();
}

CellRun expectAligned(std::vector<std::string> arguments, const std::string& strategy) {
  arguments.emplace_back("sensors:=b");
  std::vector<std::string> nodes, topics;
  const CellRun run = runCell(arguments, strategy, [&] {
    EXPECT_TRUE(ros::master::getNodes(nodes));
    ros::master::V_TopicInfo all;
    EXPECT_TRUE(ros::master::getTopics(all));
    for (const auto& topic : all) topics.push_back(topic.name);
  });
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_TRUE(isThere(nodes, "/sensor_b/driver"));
  EXPECT_FALSE(isThere(nodes, "/sensor_a/driver"));
  EXPECT_FALSE(isThere(nodes, "/twin_force_estimator"));
  EXPECT_FALSE(isThere(topics, "/sensor_a/bridge"));
  return run;
}

TEST(OneSensorCell, Aligns) { expectAligned({"twin_force:=true"}, "auto"); }

TEST(OneSensorCell, AlignsThroughAnArm) { expectAligned({"arm:=true", "seed:=4"}, "auto"); }

TEST(OneSensorCell, TwinForceIsRefusedByName) {
  const CellRun run = runCell({"sensors:=b"}, "twin_force");
  EXPECT_EQ(run.exit_code, 1) << run.output;
  EXPECT_NE(run.output.find("strategy: twin_force: "), std::string::npos) << run.output;
  EXPECT_NE(run.output.find("sensor_b alone"), std::string::npos) << run.output;
  EXPECT_TRUE(run.commands.empty()) << run.commands.size();
}

WrenchSamples::Ptr wrench(std::uint32_t sequence) {
  auto block = boost::make_shared<WrenchSamples>();
  block->header.stamp = ros::Time(10.0);
  block->sequence = sequence;
  block->period = 0.01;
  block->wrench.assign(6, 0.0);
  return block;
}

// Two of three messages of a block; the third is named.
TEST(BlockAssembly, WithOneSensorTheOtherIsNotMissed) {
  for (const Sensors sensors : {Sensors::kB, Sensors::kBoth}) {
    const bool both = sensors == Sensors::kBoth;
    BlockAssembly assembly(sensors);
    assembly.addWrench(kWrenchB, wrench(1));
    const auto carrier = boost::make_shared<geometry_msgs::PoseStamped>();
    carrier->header.stamp = ros::Time(10.0);
    assembly.addCarrier(carrier);
    EXPECT_EQ(assembly.missing(), both ? std::vector<BlockPart>({kWrenchA, kDisplacementB})
                                       : std::vector<BlockPart>({kDisplacementB}));
    const auto displacement = boost::make_shared<DisplacementSamples>();
    displacement->sequence = 1;
    assembly.addDisplacement(displacement);
    EXPECT_EQ(assembly.take().has_value(), !both);
    if (both) assembly.addWrench(kWrenchA, wrench(1));
    EXPECT_EQ(assembly.take().has_value(), both);
  }
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::one_sensor_test
