// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/cell_player.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::CellPlayer;
  return assembly_cell::ros_bridge::run<CellPlayer>(argc, argv, "cell_player");
}
