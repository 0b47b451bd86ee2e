// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_server_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::CalibrationServerNode;
  return assembly_cell::ros_bridge::run<CalibrationServerNode>(argc, argv, "calibration_server");
}
