// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/process_start.h"

#include <XmlRpcValue.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/process/master_call.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

// More than a node of a cell has open: `scripts/run`, `ls /proc/PID/fd`.
constexpr rlim_t kMinFiles = 128;
constexpr double kMasterTimeout = 5.0;    // of its response [s wall]
constexpr double kNamesakeTimeout = 0.5;  // the same of a node [s wall]
constexpr double kNamesakeEnd = 15.0;     // for it to end its goal with a free peg [s wall]
constexpr std::chrono::milliseconds kLookPeriod{20};
constexpr std::chrono::milliseconds kWatchPeriod{500};

std::atomic<bool>* shutdown_requested = nullptr;

// Presence of the master: waits until it is as wanted, at most kMasterTimeout.
template <class IsGood>
NodePresence masterPresence(const std::string& host, std::uint32_t port, const IsGood& is_good) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(kMasterTimeout);
  while (true) {
    const NodePresence presence = presenceAt(host, port, kMasterTimeout);
    if (is_good(presence) || std::chrono::steady_clock::now() > end) return presence;
    std::this_thread::sleep_for(kLookPeriod);
  }
}

std::string muteMaster(const std::string& uri) {
  return text("the ROS master at %s doesn't respond within %g s: is it stopped, or its host off?",
              printable(uri).c_str(), kMasterTimeout);
}

}  // namespace

std::optional<std::string> prepareProcess() {
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) == 0) {
    if (files.rlim_cur < kMinFiles) {
      files.rlim_cur = files.rlim_max == RLIM_INFINITY ? kMinFiles : files.rlim_max;
      setrlimit(RLIMIT_NOFILE, &files);
    }
    if (files.rlim_cur < kMinFiles) {
      return text(
          "at most %llu open files are allowed, which its connections exceed: give at "
          "least %llu, as `ulimit -n 1024` does",
          static_cast<unsigned long long>(files.rlim_cur),
          static_cast<unsigned long long>(kMinFiles));
    }
  }
  // after ros::init the master's address would be known, but that may already wait for it
  const char* master = std::getenv("ROS_MASTER_URI");
  std::string host;
  std::uint32_t port = 0;
  if (master == nullptr || !ros::network::splitURI(master, host, port)) return std::nullopt;
  const auto is_good = [](NodePresence presence) { return presence != NodePresence::kMute; };
  if (is_good(masterPresence(host, port, is_good))) return std::nullopt;
  return muteMaster(master);
}

void watchMaster(const std::string& name, const std::atomic<bool>& needed) {
  const std::string uri = ros::master::getURI();
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return;
  std::thread([=, &needed] {
    const auto is_good = [&](NodePresence presence) {
      // a refused connection ends the calls of ROS by itself
      return !needed || presence == NodePresence::kListening || presence == NodePresence::kGone;
    };
    while (is_good(masterPresence(host, port, is_good))) {
      std::this_thread::sleep_for(kWatchPeriod);
    }
    std::fprintf(stderr, "%s: %s\n", name.c_str(), muteMaster(uri).c_str());
    _exit(1);
  }).detach();
}

void replaceNamesake() {
  const auto address = callMaster("lookupNode", ros::this_node::getName(), kNamesakeTimeout);
  std::string host;
  std::uint32_t port = 0;
  if (!address || address->getType() != XmlRpc::XmlRpcValue::TypeString) return;
  const std::string uri = static_cast<std::string>(XmlRpc::XmlRpcValue(*address));
  if (!ros::network::splitURI(uri, host, port)) return;
  const auto is_there = [&] {
    return presenceAt(host, port, kNamesakeTimeout) == NodePresence::kListening;
  };
  if (!is_there()) return;
  std::fprintf(stderr, "%s: a node of this name runs already: it is ended first\n",
               ros::this_node::getName().c_str());
  callNode(uri, "shutdown", "another node of the same name was started", kNamesakeTimeout);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(kNamesakeEnd);
  while (is_there() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(kLookPeriod);
  }
}

void acceptShutdownRequests(std::atomic<bool>& requested) {
  shutdown_requested = &requested;
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind(
      "shutdown", [](XmlRpc::XmlRpcValue& parameters, XmlRpc::XmlRpcValue& result) {
        const bool has_reason =
            parameters.getType() == XmlRpc::XmlRpcValue::TypeArray && parameters.size() > 1;
        const std::string reason =
            has_reason && parameters[1].getType() == XmlRpc::XmlRpcValue::TypeString
                ? printable(static_cast<std::string>(parameters[1]), 200)
                : "no reason given";
        ROS_WARN("shutdown requested: %s", reason.c_str());
        *shutdown_requested = true;
        result = ros::xmlrpc::responseInt(1, "", 0);
      });
}

int endWithin(double limit, int code) {
  std::thread([limit, code] {
    std::this_thread::sleep_for(std::chrono::duration<double>(limit));
    std::fflush(stdout);
    _exit(code);
  }).detach();
  return code;
}

}  // namespace assembly_cell::ros_bridge
