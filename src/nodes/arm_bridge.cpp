// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_bridge_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::ArmBridgeNode;
  return assembly_cell::ros_bridge::run<ArmBridgeNode>(argc, argv, "arm_bridge");
}
