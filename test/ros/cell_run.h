// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <ros/serialization.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "assembly_cell/Exciter.h"
#include "assembly_cell/geometry/spatial.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

// One alignment of a whole cell that the test launches.
namespace assembly_cell::test {

constexpr double kRunTime = 240.0;  // of one alignment on a busy machine, wall clock [s]

/// What a run of the whole cell has left.
struct CellRun {
  int exit_code = -1;
  YAML::Node report;
  std::vector<std::string> commands;    ///< carrier_command, then exciter: serialised messages
  std::map<std::string, Pose> in_base;  ///< of static frames in carrier_base
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

/// Launches the cell, has it align once and stops it. at_end: before it stops.
inline CellRun runCell(const std::vector<std::string>& arguments, const std::string& strategy,
                       const std::function<void()>& at_end = nullptr) {
  ros::NodeHandle nh;
  CellRun out;
  const std::string file = temporaryFile("cell_report.yaml");
  Record<geometry_msgs::PoseStamped> commands(nh, "carrier_command");
  Record<Exciter> exciter(nh, "exciter");

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
  if (at_end) at_end();
  out.output = report.output();
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

/// The report without what depends on the wall clock, and without some keys.
inline std::string without(const YAML::Node& report, const std::vector<std::string>& keys) {
  YAML::Node copy = YAML::Clone(report);
  copy.remove("wall_time");
  for (const auto& key : keys) copy.remove(key);
  return YAML::Dump(copy);
}

}  // namespace assembly_cell::test
