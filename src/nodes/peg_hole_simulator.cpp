// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/node_main.h"
#include "assembly_cell/ros/simulator_node.h"

int main(int argc, char** argv) {
  // four threads: a service that waits must not hold up commands and acks
  return assembly_cell::ros_bridge::run<assembly_cell::ros_bridge::SimulatorNode>(
      argc, argv, "peg_hole_simulator", 4);
}
