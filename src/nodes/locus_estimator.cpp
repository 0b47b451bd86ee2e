// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/locus_node.h"
#include "assembly_cell/ros/node_main.h"

int main(int argc, char** argv) {
  // one thread keeps exciter and blocks in order; readings have a thread of their own
  return assembly_cell::ros_bridge::run<assembly_cell::ros_bridge::LocusNode>(argc, argv,
                                                                              "locus_estimator", 1);
}
