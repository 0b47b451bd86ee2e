// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/report_program.h"

int main(int argc, char** argv) { return assembly_cell::ros_bridge::runReport(argc, argv); }
