// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <string>

#include "assembly_cell/ros/bridge/service_call.h"

// A client of dynamic_reconfigure, as others write it.
namespace assembly_cell::test {

inline void add(dynamic_reconfigure::Config& config, const std::string& name, double value) {
  config.doubles.emplace_back();
  config.doubles.back().name = name;
  config.doubles.back().value = value;
}

inline void add(dynamic_reconfigure::Config& config, const std::string& name, bool value) {
  config.bools.emplace_back();
  config.bools.back().name = name;
  config.bools.back().value = value;
}

/// Of a switch 0 or 1.
inline double valueIn(const dynamic_reconfigure::Config& config, const std::string& name) {
  for (const auto& value : config.doubles) {
    if (value.name == name) return value.value;
  }
  for (const auto& value : config.bools) {
    if (value.name == name) return value.value ? 1.0 : 0.0;
  }
  ADD_FAILURE() << "no value of " << name;
  return 0.0;
}

/// True: taken. `after`: the value that is active then.
template <class Value>
bool setLive(const std::string& node, const std::string& name, Value value,
             dynamic_reconfigure::Config* after = nullptr) {
  dynamic_reconfigure::Reconfigure call;
  add(call.request.config, name, value);
  const std::string service = node + "/set_parameters";
  EXPECT_TRUE(ros::service::waitForService(service, ros::Duration(-1)));
  const bool taken = ros_bridge::callService(service, call);
  if (after != nullptr) *after = call.response.config;
  return taken;
}

}  // namespace assembly_cell::test
