// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <exception>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

namespace assembly_cell::ros_bridge {

/// True when Node has exitCode().
template <class Node, class = void>
struct HasExitCode : std::false_type {};
template <class Node>
struct HasExitCode<Node, std::void_t<decltype(std::declval<Node>().exitCode())>> : std::true_type {
};

/// Runs a node until shutdown: Node(nh, pnh), spun by `threads` threads. Returns 1 with one line on
/// standard error when there is no master or the construction throws; otherwise exitCode() if the
/// node has one, or 0.
template <class Node>
int run(int argc, char** argv, const std::string& name, unsigned threads = 2) {
  // outlives the try block: with its last handle gone ROS shuts down and says nothing any more
  std::unique_ptr<ros::NodeHandle> nh;
  try {
    ros::init(argc, argv, name);
    // a node handle would wait for the master for ever
    if (!ros::master::check()) {
      ROS_FATAL("%s: no ROS master at %s: start roscore or a launch file, or set ROS_MASTER_URI",
                name.c_str(), ros::master::getURI().c_str());
      return 1;
    }
    nh = std::make_unique<ros::NodeHandle>();
    ros::NodeHandle pnh("~");
    Node node(*nh, pnh);
    ros::AsyncSpinner spinner(threads);
    spinner.start();
    ros::waitForShutdown();
    spinner.stop();
    if constexpr (HasExitCode<Node>::value) return node.exitCode();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name.c_str(), error.what());
    return 1;
  }
}

}  // namespace assembly_cell::ros_bridge
