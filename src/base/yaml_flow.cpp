// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/yaml_flow.h"

namespace assembly_cell {

std::string yamlList(const double* values, std::size_t count) {
  std::string text = "[";
  for (std::size_t i = 0; i < count; ++i) text += (i > 0 ? ", " : "") + yamlNumber(values[i]);
  return text + "]";
}

YamlMapping& YamlMapping::add(const std::string& key, const std::string& yaml) {
  entries_ += (entries_.empty() ? "" : ", ") + key + ": " + yaml;
  return *this;
}

}  // namespace assembly_cell
