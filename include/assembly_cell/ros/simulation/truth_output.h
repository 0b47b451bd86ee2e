// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include "assembly_cell/dynamics/simulator_backend.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"

namespace assembly_cell::ros_bridge {

/// Publishes the ground truth: pose of the peg, contacts, and what was drawn from a mismatch.
class TruthOutput {
 public:
  TruthOutput(ros::NodeHandle& nh, const SimulatorSetup& setup);
  void publish(const SimulatorBackend& world, const ros::Time& stamp);

 private:
  ros::Publisher pose_pub_, contacts_pub_, mismatch_pub_;
};

}  // namespace assembly_cell::ros_bridge
