// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <XmlRpcValue.h>
#include <ros/master.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

/// The value of a response of ROS's XML-RPC interfaces (master, node) at `uri`; none within `limit`
/// [s], or if it is an error. The first parameter of the call, this node's name, is added.
std::optional<XmlRpc::XmlRpcValue> callNode(const std::string& uri, const std::string& method,
                                            const std::string& argument, double limit);

/// Calls the master, after ros::init. ros::master::execute() waits without a limit for a
/// master that is frozen, or whose host is off.
std::optional<XmlRpc::XmlRpcValue> callMaster(const std::string& method,
                                              const std::string& argument, double limit);

/// Nodes by topic, in the order of the master.
struct Registrations {
  std::map<std::string, std::vector<std::string>> publishers, subscribers;
};

/// What the master at `uri` has, by default this process's; none without a response within `limit`
/// [s].
std::optional<Registrations> registrations(double limit = 1.0,
                                           const std::string& uri = ros::master::getURI());

}  // namespace assembly_cell::ros_bridge
