// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/force_sensor_node.h"
#include "assembly_cell/ros/process/node_main.h"

int main(int argc, char** argv) {
  using assembly_cell::ros_bridge::ForceSensorNode;
  return assembly_cell::ros_bridge::run<ForceSensorNode>(argc, argv, "force_sensor_driver");
}
