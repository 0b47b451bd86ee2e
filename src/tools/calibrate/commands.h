// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The commands of the tool calibrate that have a help of their own.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell {

int deadWeights(const std::vector<std::string>& arguments);
int payload(const std::vector<std::string>& arguments);
int reference(const std::vector<std::string>& arguments);

}  // namespace assembly_cell
