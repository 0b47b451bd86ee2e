// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/range.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

// The numbers of a scenario by the key paths of its file.

/// One of them. The order of lists and of `scenarioNumbers` is that of the file.
struct ScenarioNumber {
  std::string key;  ///< "peg.mass", "carrier.stiffness[0]"
  double* value = nullptr;
  Range range;
  bool independent = false;  ///< no other number and no check of the file depends on it
};

/// All that a key names: itself, or the entries of a list; empty for what is neither.
std::vector<ScenarioNumber> scenarioNumbers(Scenario& scenario, const std::string& key);

/// The number of a key path; null for what is none. `independent` as in ScenarioNumber.
double* scenarioNumber(Scenario& scenario, const std::string& key, bool* independent = nullptr);

/// Names of all numbers and lists, for refusals.
std::string scenarioNumberNames();

}  // namespace assembly_cell
