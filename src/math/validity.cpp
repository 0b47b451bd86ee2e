// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/validity.h"

#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

void refuse(const char* name, double value, const char* remedy) {
  const std::string text = std::isfinite(value) ? yamlNumber(value) : "not finite";
  throw InputError(std::string(name) + ": value " + text + ": " + remedy);
}

}  // namespace assembly_cell
