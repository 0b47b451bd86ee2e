// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <ros/publisher.h>

#include <initializer_list>
#include <string>
#include <utility>

namespace assembly_cell::ros_bridge {

/// Publishes one status with these values, stamped now. publisher: of
/// diagnostic_msgs/DiagnosticArray.
void publishStatus(const ros::Publisher& publisher, diagnostic_msgs::DiagnosticStatus status,
                   std::initializer_list<std::pair<const char*, std::string>> values);

}  // namespace assembly_cell::ros_bridge
