// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>

namespace assembly_cell::ros_bridge {

/// Handles a node's command line before it connects to a master. Arguments with := are ROS's own;
/// --help prints where the node's parameters are described, others are refused in one line. Returns
/// the exit code (0, 2), or nothing if the node is to run.
std::optional<int> answerCommandLine(int argc, char** argv, const std::string& node);

}  // namespace assembly_cell::ros_bridge
