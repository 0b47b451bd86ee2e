// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/hosted_nodes.h"

#include <ros/ros.h>

#include <algorithm>
#include <utility>

namespace assembly_cell::ros_bridge {

HostedNodes& HostedNodes::ofThisProcess() {
  static HostedNodes nodes;
  return nodes;
}

void HostedNodes::fail(const std::string& node, const std::string& why) {
  ROS_FATAL("%s: %s", node.c_str(), why.c_str());
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    failed_ = true;
    exit_code_ = std::max(exit_code_, 1);
  }
  ros::requestShutdown();
}

bool HostedNodes::failed() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return failed_;
}

int HostedNodes::add(std::function<void()> stop) {
  const std::lock_guard<std::mutex> lock(mutex_);
  stops_.emplace(++numbers_, std::move(stop));
  return numbers_;
}

void HostedNodes::stop(int number) {
  std::function<void()> call;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = stops_.find(number);
    if (found == stops_.end()) return;
    call = std::move(found->second);
    stops_.erase(found);
  }
  // it may wait for a goal that frees the peg
  call();
}

void HostedNodes::stopAll() {
  while (true) {
    int number = 0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stops_.empty()) return;
      number = stops_.begin()->first;
    }
    stop(number);
  }
}

void HostedNodes::ended(int code) {
  const std::lock_guard<std::mutex> lock(mutex_);
  exit_code_ = std::max(exit_code_, code);
}

int HostedNodes::exitCode() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return exit_code_;
}

}  // namespace assembly_cell::ros_bridge
