// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/source_parameters.h"

#include <algorithm>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

SourceParameters::SourceParameters(const YAML::Node& map, const std::string& subject)
    : Section(map.IsDefined() && !map.IsNull() ? map : YAML::Node(YAML::NodeType::Map), "",
              subject) {}

int SourceParameters::integer(const std::string& key, int min, int max,
                              std::optional<int> fallback) {
  return static_cast<int>(Section::integer(key, min, max, fallback));
}

std::string SourceParameters::text(const std::string& key,
                                   const std::optional<std::string>& fallback) {
  constexpr std::size_t kLongest = 1024;
  if (fallback && !optional(key)) return *fallback;
  const std::string what = "give at most " + std::to_string(kLongest) + " characters, a line";
  const std::string value = Section::text(key, what);
  if (value.size() > kLongest || !isLine(value)) refuse(key, printable(value), what);
  return value;
}

std::vector<std::string> SourceParameters::texts(const std::string& key,
                                                 const std::vector<std::string>& fallback) {
  return optional(key) ? Section::texts(key) : fallback;
}

std::vector<double> SourceParameters::numbers(const std::string& key,
                                              const std::vector<double>& fallback) {
  return optional(key) ? Section::numbers(key, fallback.size()) : fallback;
}

void SourceParameters::refuseUnknown() const {
  std::string names;
  for (const std::string& name : known()) names += (names.empty() ? "" : ", ") + name;
  for (const std::string& key : keys()) {
    if (key == "type" || std::count(known().begin(), known().end(), key) != 0) continue;
    throw InputError(source() + ": key '" + printable(key) + "' is unknown: there are " + names);
  }
}

}  // namespace assembly_cell
