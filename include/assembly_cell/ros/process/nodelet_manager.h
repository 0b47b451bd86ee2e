// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <nodelet/loader.h>
#include <ros/ros.h>

#include <string>

namespace assembly_cell::ros_bridge {

/// A nodelet to load, from a line TYPE NAME [FROM:=TO ...].
struct NodeletLine {
  std::string type, name;
  ros::M_string remappings;
};
/// Throws InputError that names `parameter`.
NodeletLine parseNodeletLine(const std::string& line, const std::string& parameter);

/// Node nodelet_manager: the nodes of a cell in one process. Loads the nodelets that ~nodelets
/// names, in that order, and ends with an error if one of them can't start or fails. Others may be
/// loaded by the services of any nodelet manager. Interfaces: docs/reference/interfaces.md.
class NodeletManager {
 public:
  /// Threads of the services.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter.
  NodeletManager(ros::NodeHandle& nh, ros::NodeHandle& pnh);

  void stop();  ///< ends all nodes, their active goals first
  int exitCode() const;

 private:
  nodelet::Loader loader_;
};

}  // namespace assembly_cell::ros_bridge
