// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/node_main.h"
#include "assembly_cell/ros/simulation/contact_markers_node.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::ContactMarkersNode;
  return assembly_cell::ros_bridge::run<ContactMarkersNode>(argc, argv, "contact_markers");
}
