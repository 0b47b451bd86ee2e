// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/lockstep.h"

#include <ros/ros.h>

namespace assembly_cell::ros_bridge {

std::string participantName(const std::string& root, const std::string& node) {
  const std::string above = root == "/" ? "/" : root + "/";
  return node.compare(0, above.size(), above) == 0 ? node.substr(above.size()) : node.substr(1);
}

std::string participantNode(const std::string& root, const std::string& participant) {
  return ros::names::append(root, participant);
}

}  // namespace assembly_cell::ros_bridge
