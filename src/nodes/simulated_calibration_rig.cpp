// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/node_main.h"
#include "assembly_cell/ros/simulated_rig_node.h"

int main(int argc, char** argv) {
  return assembly_cell::ros_bridge::run<assembly_cell::ros_bridge::SimulatedRigNode>(
      argc, argv, "simulated_calibration_rig");
}
