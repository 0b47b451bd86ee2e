// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <malloc.h>
#include "assembly_cell/ros/nodelet_manager.h"
#include "assembly_cell/ros/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::NodeletManager;
  mallopt(M_TRIM_THRESHOLD, 64 << 20); mallopt(M_TOP_PAD, 1 << 20); mallopt(M_MMAP_THRESHOLD, 64<<20);
  return assembly_cell::ros_bridge::run<NodeletManager>(argc, argv, "nodelet_manager");
}
