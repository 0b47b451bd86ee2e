// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/node_main.h"
#include "assembly_cell/ros/supervision/identifier_node.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::IdentifierNode;
  return assembly_cell::ros_bridge::run<IdentifierNode>(argc, argv, "mechanism_identifier");
}
