// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell::ros_bridge {

/// Reads a bag once in a separate process (the program check_bag), because ROS's bag library can
/// throw uncaught exceptions, crash or decompress for ever if a bag is damaged.
/// Throws InputError "<what> can't be read: ...", one line.
void checkBag(const std::string& path, const std::string& what);

/// The program check_bag. Returns 0, 1 for a damaged bag or 2 for bad arguments, with one line that
/// names the fault.
int runBagCheck(int argc, char** argv);

}  // namespace assembly_cell::ros_bridge
