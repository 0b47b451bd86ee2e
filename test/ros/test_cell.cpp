// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <ros/serialization.h>
#include <stdlib.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>
#include <visualization_msgs/MarkerArray.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/geometry/spatial.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::waitFor;

constexpr double kRunTime = 240.0;  // of one alignment on a busy machine, wall clock [s]

// what a run of the whole cell has left
struct CellRun {
  int exit_code = -1;
  YAML::Node report;
  std::vector<std::string> commands;  // carrier_command, then exciter: serialised messages
  std::size_t markers = 0;
  std::map<std::string, Pose> in_base;    // of static frames in carrier_base
  std::vector<std::string> undocumented;  // topics and services that the page doesn't name
  std::string output;
};

template <class M>
void serialise(const Record<M>& record, std::vector<std::string>& out) {
  std::uint32_t expected = 0;
  for (const auto& message : record.all()) {
    // none is missing
    EXPECT_EQ(message->header.seq, expected++);
    const auto size = ros::serialization::serializationLength(*message);
    std::string bytes(size, '\0');
    ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                       static_cast<std::uint32_t>(size));
    ros::serialization::serialize(stream, *message);
    out.push_back(bytes);
  }
}

std::vector<std::string> undocumented();

// launches the cell, has it align once and stops it
CellRun run(const std::vector<std::string>& arguments, bool watched,
            const std::string& strategy = "single_contact") {
  ros::NodeHandle nh;
  CellRun out;
  const std::string file =
      std::string(::testing::TempDir()) + "cell_report_" + std::to_string(getpid()) + ".yaml";
  Record<geometry_msgs::PoseStamped> commands(nh, "carrier_command");
  Record<Exciter> exciter(nh, "exciter");
  std::unique_ptr<Record<ContactArray>> contacts;
  std::unique_ptr<Record<visualization_msgs::MarkerArray>> markers;
  if (watched) {
    contacts = std::make_unique<Record<ContactArray>>(nh, "truth/contacts");
    markers = std::make_unique<Record<visualization_msgs::MarkerArray>>(nh, "markers");
  }

  std::vector<std::string> command = {"roslaunch",      "assembly_cell",   "cell.launch",
                                      "lockstep:=true", "slow_factor:=10", "paused:=true"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  Child cell(command);
  EXPECT_TRUE(waitFor([&] {
    return !cell.running() || (commands.connected() && exciter.connected());
  })) << cell.output();
  EXPECT_TRUE(cell.running()) << cell.output();

  const Record<tf2_msgs::TFMessage> frames(nh, "/tf_static");
  Child report({executable("report"), "_report_file:=" + file, "_strategy:=" + strategy});
  EXPECT_TRUE(waitFor([&] { return !report.running() || !cell.running(); }, kRunTime))
      << report.output();
  EXPECT_TRUE(cell.running()) << cell.output();
  out.exit_code = report.wait();
  if (watched) out.undocumented = undocumented();
  out.output = report.output();
  if (markers) out.markers = markers->size();
  for (const auto& message : frames.all()) {
    for (const auto& t : message->transforms) {
      if (t.header.frame_id != "carrier_base") continue;
      const auto& p = t.transform.translation;
      const auto& q = t.transform.rotation;
      out.in_base[t.child_frame_id] = {Eigen::Quaterniond(q.w, q.x, q.y, q.z).toRotationMatrix(),
                                       Eigen::Vector3d(p.x, p.y, p.z)};
    }
  }
  cell.stop();
  serialise(commands, out.commands);
  serialise(exciter, out.commands);
  if (access(file.c_str(), R_OK) == 0) out.report = YAML::LoadFile(file);
  unlink(file.c_str());
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
  std::vector<std::string> files = {test::sourceFile("docs/interfaces.md")};
  for (const auto& entry :
       std::filesystem::directory_iterator(test::sourceFile("docs/interfaces"))) {
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
      "/peg_hole_simulator",  "/sensor_a/driver", "/sensor_b/driver",     "/locus_estimator",
      "/assembly_supervisor", "/contact_markers", "/twin_force_estimator"};
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

// the report without what depends on the wall clock, and without some keys
std::string without(const YAML::Node& report, const std::vector<std::string>& keys) {
  YAML::Node copy = YAML::Clone(report);
  copy.remove("wall_time");
  for (const auto& key : keys) copy.remove(key);
  return YAML::Dump(copy);
}

TEST(Cell, AlignsInLockstepTheSameToTheLastBitSeenOrUnseen) {
  // once with everybody looking, once with nobody, once without any truth to look at
  const CellRun seen = run({}, true);
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

TEST(Cell, AlignsFromBothSensorsWrenches) {
  const CellRun both = run({"twin_force:=true"}, true, "twin_force");
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
}  // namespace assembly_cell::ros_bridge

int main(int argc, char** argv) {
  ros::init(argc, argv, "cell_test");
  ::testing::InitGoogleTest(&argc, argv);
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
