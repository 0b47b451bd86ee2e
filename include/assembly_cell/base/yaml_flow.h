// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <string>

#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

/// Numbers as a list on one line, "[1.0, 2.5]".
std::string yamlList(const double* values, std::size_t count);
/// The same of a std::vector, or an Eigen vector or row-major matrix.
template <class Numbers>
std::string yamlList(const Numbers& numbers) {
  return yamlList(numbers.data(), static_cast<std::size_t>(numbers.size()));
}

/// A mapping on one line, "{key: value, ...}", its keys in the order of the calls.
class YamlMapping {
 public:
  /// `yaml`: the value as it is written.
  YamlMapping& add(const std::string& key, const std::string& yaml);
  YamlMapping& number(const std::string& key, double value) { return add(key, yamlNumber(value)); }
  YamlMapping& integer(const std::string& key, long value) {
    return add(key, std::to_string(value));
  }
  YamlMapping& quoted(const std::string& key, const std::string& text) {
    return add(key, yamlQuoted(text));
  }
  std::string text() const { return "{" + entries_ + "}"; }

 private:
  std::string entries_;
};

}  // namespace assembly_cell
