// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell {

/// What the script from_bag.py, which stands beside the running tool, takes out of a bag: the core
/// knows no ROS. what: observations, or locus (samples as CSV) with the topic as option. Throws
/// InputError with the script's line.
std::string textFromBag(const std::string& what, const std::string& path,
                        const std::string& option = {});

}  // namespace assembly_cell
