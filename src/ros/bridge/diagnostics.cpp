// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/diagnostics.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/time.h>

namespace assembly_cell::ros_bridge {

void publishStatus(const ros::Publisher& publisher, diagnostic_msgs::DiagnosticStatus status,
                   std::initializer_list<std::pair<const char*, std::string>> values) {
  for (const auto& [key, value] : values) {
    status.values.emplace_back();
    status.values.back().key = key;
    status.values.back().value = value;
  }
  diagnostic_msgs::DiagnosticArray array;
  array.header.stamp = ros::Time::now();
  array.status.push_back(status);
  publisher.publish(array);
}

}  // namespace assembly_cell::ros_bridge
