// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/date.h"

#include <ctime>

namespace assembly_cell {

std::string utcNow(const char* pattern) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32] = "";
  std::strftime(text, sizeof text, pattern, &utc);
  return text;
}

}  // namespace assembly_cell
