// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/process/command_line.h"

namespace assembly_cell::ros_bridge {

/// For a master that isn't there, before a node gives up: wall clock [s].
constexpr double kMasterPatience = 1.0;

/// While roslaunch may still be starting other nodes: wall clock [s]. For a cell it needs 0.2 to
/// 0.5 s beside three busy programs on two cores, 0.7 s beside eight.
constexpr double kLaunching = 2.0;

/// True when Node has exitCode().
template <class Node, class = void>
struct HasExitCode : std::false_type {};
template <class Node>
struct HasExitCode<Node, std::void_t<decltype(std::declval<Node>().exitCode())>> : std::true_type {
};

/// True when Node has stop().
template <class Node, class = void>
struct HasStop : std::false_type {};
template <class Node>
struct HasStop<Node, std::void_t<decltype(std::declval<Node>().stop())>> : std::true_type {};

/// Waits for ROS's shutdown, or for SIGINT or SIGTERM, which a node with stop() takes for itself.
inline void waitForSignal() {
  static std::atomic<bool> asked{false};
  struct sigaction action = {};
  action.sa_handler = [](int) { asked = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  while (ros::ok() && !asked) ros::WallDuration(0.02).sleep();
}

/// Of a command line that ROS hasn't taken its own arguments from.
inline bool isFromRoslaunch(int argc, char** argv) {
  return std::any_of(argv, argv + argc, [](const char* argument) {
    return std::string_view(argument).substr(0, 7) == "__log:=";  // roslaunch alone gives it
  });
}

/// Runs a node until shutdown: Node(nh, pnh), spun by Node::kThreads threads. No exception of a
/// callback ends it; its diagnostics tell what it has refused and survived. Returns 1 with one line
/// on standard error when there is no master or the construction throws; otherwise exitCode() if
/// the node has one, or 0; 0 or 2 for a command line that is answered by itself. A node that has
/// stop() is stopped by SIGINT or SIGTERM while it can still publish.
template <class Node>
int run(int argc, char** argv, const std::string& name) {
  const auto begin = std::chrono::steady_clock::now();
  const bool launched = isFromRoslaunch(argc, argv);
  if (const auto answered = answerCommandLine(argc, argv, name)) return *answered;
  // outlives the try block: with its last handle gone ROS shuts down and says nothing any more
  std::unique_ptr<ros::NodeHandle> nh;
  try {
    // parameters of the command line are set at once, without a master for ever
    ros::master::setRetryTimeout(ros::WallDuration(kMasterPatience));
    ros::init(argc, argv, name, HasStop<Node>::value ? ros::init_options::NoSigintHandler : 0);
    // a node handle would wait for the master for ever
    if (!ros::master::check()) {
      ROS_FATAL("%s: no ROS master at %s: start roscore or a launch file, or set ROS_MASTER_URI",
                name.c_str(), ros::master::getURI().c_str());
      return 1;
    }
    ros::master::setRetryTimeout(ros::WallDuration(0.0));
    nh = std::make_unique<ros::NodeHandle>();
    ros::NodeHandle pnh("~");
    Node node(*nh, pnh);
    const IncomingDiagnostics diagnostics(*nh);
    GuardedSpinner spinner(Node::kThreads);
    spinner.start();
    if constexpr (HasStop<Node>::value) {
      waitForSignal();
      node.stop();
      // what it said last is on its way
      ros::WallDuration(0.1).sleep();
    } else {
      spinner.wait();
    }
    spinner.stop();
    if constexpr (HasExitCode<Node>::value) return node.exitCode();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name.c_str(), error.what());
    // Roslaunch leaves its master, and what it has started, when a required node ends while others
    // are still being started.
    if (launched) std::this_thread::sleep_until(begin + std::chrono::duration<double>(kLaunching));
    return 1;
  }
}

}  // namespace assembly_cell::ros_bridge
