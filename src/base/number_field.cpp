// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/number_field.h"

#include <algorithm>

namespace assembly_cell {

void readFields(yaml::Section& in, const std::vector<NumberField>& fields) {
  for (const NumberField& field : fields) {
    if (!in.optional(field.name)) continue;
    if (field.count > 1) {
      const std::vector<double> row = in.numbers(field.name, field.count);
      std::copy(row.begin(), row.end(), field.values);
    } else if (field.high < NumberField::kMost) {
      *field.values = in.number(field.name, field.low, field.high);
    } else {
      const yaml::Range range =
          field.low > 0.0 ? yaml::Range::kPositive : yaml::Range::kNotNegative;
      *field.values = in.number(field.name, range);
    }
  }
}

}  // namespace assembly_cell
