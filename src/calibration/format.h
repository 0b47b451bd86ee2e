// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdio>
#include <string>

namespace assembly_cell {

/// Numbers in a printf pattern.
template <typename... Numbers>
std::string format(const char* pattern, Numbers... numbers) {
  char text[300];
  std::snprintf(text, sizeof text, pattern, numbers...);
  return text;
}

}  // namespace assembly_cell
