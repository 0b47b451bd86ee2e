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

}  // namespace assembly_cell
