// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/ContactArray.h"
#include "cell_run.h"

namespace assembly_cell::ros_bridge::cell_test {
namespace {

using test::CellRun;
using test::Record;
using test::runCell;
using test::without;

std::vector<std::string> undocumented();

// and what was seen of it
struct SeenRun : CellRun {
  std::size_t markers = 0;
  std::vector<std::string> undocumented;  // topics and services that the page doesn't name
};

// with observers of everything, or with none
SeenRun run(const std::vector<std::string>& arguments, bool watched,
            const std::string& strategy = "single_contact") {
  ros::NodeHandle nh;
  SeenRun out;
  std::unique_ptr<Record<ContactArray>> contacts;
  std::unique_ptr<Record<visualization_msgs::MarkerArray>> markers;
  if (watched) {
    contacts = std::make_unique<Record<ContactArray>>(nh, "truth/contacts");
    markers = std::make_unique<Record<visualization_msgs::MarkerArray>>(nh, "markers");
  }
  static_cast<CellRun&>(out) = runCell(arguments, strategy, [&] {
    if (watched) out.undocumented = undocumented();
  });
  if (markers) out.markers = markers->size();
  return out;
}

// names of topics and services that the page may leave out: ROS's own, and the parts of an action
bool common(const std::string& name) {
  for (const std::string part : {"/rosout", "/tf_static", "/get_loggers", "/set_logger_level"}) {
    if (name.find(part) != std::string::npos) return true;
  }
  return false;
}

// what the page on interfaces and those of the nodes say
std::string interfacePages() {
  std::vector<std::string> files = {test::sourceFile("docs/reference/interfaces.md")};
  for (const auto& entry :
       std::filesystem::directory_iterator(test::sourceFile("docs/reference/nodes"))) {
    files.push_back(entry.path());
  }
  std::string text;
  for (const std::string& name : files) {
    std::ifstream file(name);
    text.append(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return text;
}

// every topic and service of the running cell's nodes that the pages do not name
std::vector<std::string> undocumented() {
  const std::string page = interfacePages();
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  EXPECT_TRUE(ros::master::execute("getSystemState", request, response, state, false));
  const std::vector<std::string> nodes = {
      "/peg_hole_simulator",  "/sensor_a/driver", "/sensor_b/driver",      "/locus_estimator",
      "/assembly_supervisor", "/contact_markers", "/twin_force_estimator", "/assembly_recorder"};
  std::vector<std::string> missing;
  int found = 0;
  for (int kind = 0; kind < 3; ++kind) {
    for (int i = 0; i < state[kind].size(); ++i) {
      const std::string name = state[kind][i][0];
      bool ours = false;
      for (int k = 0; k < state[kind][i][1].size(); ++k) {
        const std::string node = state[kind][i][1][k];
        ours |= std::find(nodes.begin(), nodes.end(), node) != nodes.end();
      }
      if (!ours || common(name)) continue;
      ++found;
      // as it is, relative to the cell, to the sensor's group, to a node, or an action by its name
      std::vector<std::string> spellings = {name, name.substr(1)};
      for (const std::string group : {"/sensor_a/", "/sensor_b/"}) {
        if (name.rfind(group, 0) == 0) spellings.push_back(name.substr(group.size()));
      }
      for (const std::string& node : nodes) {
        if (name.rfind(node + "/", 0) == 0) spellings.push_back("~" + name.substr(node.size() + 1));
      }
      const std::size_t last = name.rfind('/');
      for (const std::string part : {"goal", "cancel", "feedback", "result", "status"}) {
        if (last > 0 && name.substr(last + 1) == part)
          spellings.push_back(name.substr(1, last - 1));
      }
      const bool named = std::any_of(spellings.begin(), spellings.end(), [&](const auto& spelling) {
        return page.find("`" + spelling + "`") != std::string::npos;
      });
      if (!named) missing.push_back(name);
    }
  }
  // the cell has far more than these; else the question was wrong
  EXPECT_GT(found, 30);
  return missing;
}

TEST(Cell, AlignsInLockstepTheSameToTheLastBitSeenOrUnseen) {
  // once with all observers, once with none, once without any truth to look at
  const SeenRun seen = run({}, true);
  ASSERT_EQ(seen.exit_code, 0) << seen.output;
  EXPECT_GT(seen.markers, 0U);
  EXPECT_EQ(seen.undocumented, std::vector<std::string>{});
  EXPECT_TRUE(seen.report["success"].as<bool>());
  EXPECT_TRUE(seen.report["verdict"].as<bool>());
  EXPECT_LE(seen.report["edge_reach"].as<double>(), seen.report["hole_radius"].as<double>());
  EXPECT_GT(seen.commands.size(), 100U);
  // several millimetres and about a degree off at the start
  const auto offset = seen.report["true_offset"].as<std::vector<double>>();
  const auto tilt = seen.report["true_tilt"].as<std::vector<double>>();
  EXPECT_GT(std::hypot(offset[0], offset[1]), 3e-3);
  EXPECT_GT(std::hypot(tilt[0], tilt[1]), 0.01);

  // the hole was found where it is, within the clearance of 0.1 mm, its rim where the edge is
  ASSERT_EQ(seen.in_base.count("hole_estimated") + seen.in_base.count("hole_truth"), 2U);
  const Pose error = inverse(seen.in_base.at("hole_truth")) * seen.in_base.at("hole_estimated");
  EXPECT_LT(error.p.head<2>().norm(), 1e-4);
  EXPECT_LT(std::abs(error.p.z()), 2e-3);
  EXPECT_LT(error.R.col(2).head<2>().norm(), 2e-3);

  const CellRun unseen = run({}, false);
  ASSERT_EQ(unseen.exit_code, 0) << unseen.output;
  EXPECT_EQ(without(unseen.report, {}), without(seen.report, {}));
  EXPECT_TRUE(unseen.commands == seen.commands)
      << unseen.commands.size() << " and " << seen.commands.size() << " commands";

  const CellRun blind = run({"publish_truth:=false"}, false);
  ASSERT_EQ(blind.exit_code, 0) << blind.output;
  EXPECT_FALSE(blind.report["truth_known"].as<bool>());
  EXPECT_EQ(blind.in_base.count("hole_estimated"), 1U);
  EXPECT_EQ(blind.in_base.count("hole_truth"), 0U);
  EXPECT_TRUE(blind.report["true_offset"].IsNull());
  const std::vector<std::string> truth = {"truth_known",     "true_offset", "true_tilt",
                                          "true_pose_start", "true_pose",   "edge_reach"};
  EXPECT_EQ(without(blind.report, truth), without(seen.report, truth));
  EXPECT_TRUE(blind.commands == seen.commands)
      << blind.commands.size() << " and " << seen.commands.size() << " commands";
}

TEST(Cell, RefusesOneSensorsCalibrationForBoth) {
  const std::string file = test::sourceFile("config/calibration/sensor_b.yaml");
  const CellRun run = runCell({"calibration_a:=" + file}, "touch");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_NE(run.output.find("both have a calibration of 'simulated-b'"), std::string::npos)
      << run.output;
}

TEST(Cell, AlignsFromBothSensorsWrenches) {
  const SeenRun both = run({"twin_force:=true"}, true, "twin_force");
  ASSERT_EQ(both.exit_code, 0) << both.output;
  EXPECT_EQ(both.undocumented, std::vector<std::string>{});
  EXPECT_TRUE(both.report["verdict"].as<bool>());
  EXPECT_EQ(both.report["strategy"].as<std::string>(), "twin_force");
  EXPECT_GE(both.report["contacts"].as<int>(), 3);
  // a fifth of the clearance of 0.1 mm
  const auto offset = both.report["true_offset"].as<std::vector<double>>();
  const auto estimated = both.report["estimated_offset"].as<std::vector<double>>();
  EXPECT_LT(std::hypot(offset[0] - estimated[0], offset[1] - estimated[1]), 2e-5);

  const CellRun blind = run({"twin_force:=true", "publish_truth:=false"}, false, "twin_force");
  ASSERT_EQ(blind.exit_code, 0) << blind.output;
  EXPECT_TRUE(blind.commands == both.commands)
      << blind.commands.size() << " and " << both.commands.size() << " commands";
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::cell_test
