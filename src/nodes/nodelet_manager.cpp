// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <malloc.h>

#include "assembly_cell/ros/process/node_main.h"
#include "assembly_cell/ros/process/nodelet_manager.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::NodeletManager;
  // Each block of samples takes some 50 kB for a moment. Given back to the kernel, its pages are
  // cleared and mapped again for the next one: 7 % of an alignment in lockstep.
  mallopt(M_TRIM_THRESHOLD, 64 << 20);
  mallopt(M_TOP_PAD, 1 << 20);
  // One heap: what a thread leaves the next one takes. Those of other threads grow page by page.
  mallopt(M_ARENA_MAX, 1);
  return assembly_cell::ros_bridge::run<NodeletManager>(argc, argv, "nodelet_manager");
}
