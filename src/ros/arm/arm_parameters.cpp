// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_parameters.h"

#include <algorithm>

namespace assembly_cell::ros_bridge {

void readFields(Parameters& parameters, const std::vector<NumberField>& fields) {
  for (const NumberField& field : fields) {
    if (field.count == 1) {
      *field.values = parameters.number(field.name, Range{field.low, field.high}, *field.values);
      continue;
    }
    const std::vector<double> row = parameters.numbers(
        field.name, field.count, std::vector<double>(field.values, field.values + field.count));
    std::copy(row.begin(), row.end(), field.values);
  }
}

}  // namespace assembly_cell::ros_bridge
