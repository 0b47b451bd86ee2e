// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {

/// A number, or a row of them, that a file or a node's parameters may change: by this name, within
/// these bounds. What stands there before is the default.
struct NumberField {
  static constexpr double kMost = std::numeric_limits<double>::max();
  static constexpr double kLeast = std::numeric_limits<double>::min();  ///< that is positive

  const char* name;
  double low, high;  ///< included; of a row of numbers not looked at
  double* values;
  std::size_t count = 1;
};

/// Those that the section has; the others keep what they are. Throws InputError.
void readFields(yaml::Section& in, const std::vector<NumberField>& fields);

}  // namespace assembly_cell
