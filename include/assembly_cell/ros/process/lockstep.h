// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell::ros_bridge {

/// The name of `node` in the simulator's ~participants: relative to `root`, the cell's namespace.
/// Outside of it, the whole name without the first slash. A node is known by the namespace of its
/// private handle: as a nodelet it shares the name of its process with others.
std::string participantName(const std::string& root, const std::string& node);

/// The node that goes by the name `participant` in the cell of namespace `root`.
std::string participantNode(const std::string& root, const std::string& participant);

}  // namespace assembly_cell::ros_bridge
