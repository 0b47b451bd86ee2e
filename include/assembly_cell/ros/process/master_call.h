// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <XmlRpcValue.h>

#include <optional>
#include <string>

namespace assembly_cell::ros_bridge {

/// The value of a response of ROS's XML-RPC interfaces (master, node) at `uri`; none within `limit`
/// [s], or if it is an error. The first parameter of the call, this node's name, is added.
std::optional<XmlRpc::XmlRpcValue> callNode(const std::string& uri, const std::string& method,
                                            const std::string& argument, double limit);

/// The same of the master, after ros::init. ros::master::execute() waits without a limit for a
/// master that is frozen, or whose host is off.
std::optional<XmlRpc::XmlRpcValue> callMaster(const std::string& method,
                                              const std::string& argument, double limit);

}  // namespace assembly_cell::ros_bridge
