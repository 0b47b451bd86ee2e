// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/locus_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::LocusNode;
  return assembly_cell::ros_bridge::run<LocusNode>(argc, argv, "locus_estimator");
}
