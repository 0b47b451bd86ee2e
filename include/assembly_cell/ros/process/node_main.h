// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/incoming_log.h"
#include "assembly_cell/ros/process/command_line.h"
#include "assembly_cell/ros/process/log_relay.h"
#include "assembly_cell/ros/process/process_start.h"

namespace assembly_cell::ros_bridge {

/// Time for ROS's own end after a node's, wall clock [s].
constexpr double kEndTimeout = 10.0;

/// Wait for a ROS master, wall clock [s].
constexpr double kMasterTimeout = 1.0;

/// Time in which roslaunch may still be starting other nodes, wall clock [s]. A cell takes 0.2 to
/// 0.5 s with three busy programs on two cores, 0.7 s with eight.
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

/// Waits for ROS's shutdown, or for SIGINT, SIGTERM or a request of another node, which a node with
/// stop() handles itself.
inline void waitForSignal() {
  static std::atomic<bool> received{false};
  struct sigaction action = {};
  action.sa_handler = [](int) { received = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  acceptShutdownRequests(received);
  while (ros::ok() && !received) ros::WallDuration(0.02).sleep();
}

/// Whether roslaunch started the node, by its command line.
inline bool isFromRoslaunch(int argc, char** argv) {
  return std::any_of(argv, argv + argc, [](const char* argument) {
    return std::string_view(argument).substr(0, 7) == "__log:=";  // only roslaunch sets it
  });
}

/// Runs a node until shutdown: Node(nh, pnh), spun by Node::kThreads threads. Exceptions of
/// callbacks don't end it; they are in its diagnostics, with refused messages. Returns 1 with one
/// line on standard error if there is no master or the construction throws; otherwise exitCode() if
/// the node has one, or 0; 0 or 2 for arguments like --help. A node with stop() is stopped by
/// SIGINT or SIGTERM while it can still publish.
template <class Node>
int run(int argc, char** argv, const std::string& name) {
  const auto begin = std::chrono::steady_clock::now();
  const bool launched = isFromRoslaunch(argc, argv);
  if (const auto answered = answerCommandLine(argc, argv, name)) return *answered;
  const LogRelay relay;
  if (const auto why = prepareProcess()) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), why->c_str());
    return 1;
  }
  // outlives the try block: without a handle ROS shuts down and logs nothing any more
  std::unique_ptr<ros::NodeHandle> nh;
  try {
    // parameters of the command line are set in ros::init, which waits for the master
    ros::master::setRetryTimeout(ros::WallDuration(kMasterTimeout));
    ros::init(argc, argv, name, HasStop<Node>::value ? ros::init_options::NoSigintHandler : 0);
    // a node handle would wait for the master without a limit
    if (!ros::master::check()) {
      ROS_FATAL("%s: no ROS master at %s: start roscore or a launch file, or set ROS_MASTER_URI",
                name.c_str(), ros::master::getURI().c_str());
      return 1;
    }
    ros::master::setRetryTimeout(ros::WallDuration(0.0));
    if constexpr (HasStop<Node>::value) replaceNamesake();
    nh = std::make_unique<ros::NodeHandle>();
    ros::NodeHandle pnh("~");
    Node node(*nh, pnh);
    const IncomingDiagnostics diagnostics(*nh);
    GuardedSpinner spinner(Node::kThreads);
    spinner.start();
    if constexpr (HasStop<Node>::value) {
      waitForSignal();
      node.stop();
      // its last messages are being sent
      ros::WallDuration(0.1).sleep();
    } else {
      spinner.wait();
    }
    spinner.stop();
    if constexpr (HasExitCode<Node>::value) return endWithin(kEndTimeout, node.exitCode());
    return endWithin(kEndTimeout, 0);
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name.c_str(), error.what());
    endWithin(kLaunching + kEndTimeout, 1);
    // if a required node ends during the start of others, roslaunch doesn't end those nor its
    // master
    if (launched) std::this_thread::sleep_until(begin + std::chrono::duration<double>(kLaunching));
    return 1;
  }
}

}  // namespace assembly_cell::ros_bridge
