// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::TwinForceNode;
  return assembly_cell::ros_bridge::run<TwinForceNode>(argc, argv, "twin_force_estimator");
}
