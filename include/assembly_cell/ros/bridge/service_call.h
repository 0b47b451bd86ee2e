// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <string>

namespace assembly_cell::ros_bridge {

/// Calls a service (resolved name) and waits for its answer; false without one. Unlike
/// ros::service::call over a connection that the caller closes: there the server closes it after
/// its answer, and on a busy machine roscpp may take that for the end of the call before it has
/// read the answer (ros_comm issue 1976; 2 of 3000 calls with three busy processes on two cores).
template <class Service>
bool callService(const std::string& name, Service& service) {
  ros::NodeHandle nh;
  constexpr bool kPersistent = true;
  return nh.serviceClient<Service>(name, kPersistent).call(service);
}

}  // namespace assembly_cell::ros_bridge
