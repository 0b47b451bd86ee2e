// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/contact_markers_node.h"
#include "assembly_cell/ros/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::ContactMarkersNode;
  return assembly_cell::ros_bridge::run<ContactMarkersNode>(argc, argv, "contact_markers");
}
