// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell {

/// The present time, UTC, by a pattern of strftime; at most 31 characters.
std::string utcNow(const char* pattern = "%Y-%m-%d");

}  // namespace assembly_cell
