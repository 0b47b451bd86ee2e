// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Scenarios of the package.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

/// config/scenarios/NAME.yaml
inline Scenario load(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/" + name + ".yaml",
                      overrides);
}

inline Scenario cell(const std::vector<std::string>& overrides = {}) {
  return load("cell", overrides);
}

}  // namespace assembly_cell
