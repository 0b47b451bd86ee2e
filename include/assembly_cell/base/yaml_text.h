// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <string>

namespace assembly_cell {

/// The shortest text that reads back as the same number and is a float for every YAML reader (a
/// point before an exponent); null for what is not finite.
std::string yamlNumber(double value);

/// Text as a double-quoted scalar on one line.
std::string yamlQuoted(const std::string& text);

/// How deep lists and mappings of a YAML text stand in each other at most: never less than a reader
/// would find. Readers recurse: what is deeper than kDeepestYaml must not reach them.
std::size_t yamlDepth(const std::string& text);
constexpr std::size_t kDeepestYaml = 200;

/// Empty, or why the text is too deep to be read.
std::string tooDeep(const std::string& text);

/// A number and nothing else in `text`, finite; false otherwise.
bool parseNumber(const std::string& text, double& value);
bool parseInteger(const std::string& text, long& value);

/// Numbers as a list on one line, "[1.0, 2.5]".
std::string yamlList(const double* values, std::size_t count);
/// Text of a std::vector, or of an Eigen vector or row-major matrix.
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
