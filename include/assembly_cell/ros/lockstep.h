// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell::ros_bridge {

/// This node's name in the simulator's ~participants: relative to `root`, the cell's namespace.
/// Outside of it, the whole name without the first slash.
std::string participantName(const std::string& root);

/// The node that goes by the name `participant` in the cell of namespace `root`.
std::string participantNode(const std::string& root, const std::string& participant);

}  // namespace assembly_cell::ros_bridge
