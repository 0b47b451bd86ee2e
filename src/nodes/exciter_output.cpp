// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/exciter_output_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::ExciterOutputNode;
  return assembly_cell::ros_bridge::run<ExciterOutputNode>(argc, argv, "exciter_output");
}
