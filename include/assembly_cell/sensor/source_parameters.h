// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {

/// Reads the YAML map of a StrainSource. A key without a fallback is required. Missing, of the
/// wrong type, not finite or out of range: InputError, one line with the source, the key, its value
/// and what to do.
class SourceParameters : public yaml::Section {
 public:
  /// Null counts as an empty map. `subject` begins messages, as "source netft". Throws InputError
  /// for anything but a map.
  SourceParameters(const YAML::Node& map, const std::string& subject);

  int integer(const std::string& key, int min, int max, std::optional<int> fallback = std::nullopt);
  /// At most 1024 characters, printable.
  std::string text(const std::string& key,
                   const std::optional<std::string>& fallback = std::nullopt);
  std::vector<std::string> texts(const std::string& key, const std::vector<std::string>& fallback);
  std::vector<double> numbers(const std::string& key, const std::vector<double>& fallback);

  /// Throws for a key that none of the calls above has asked for (`type` apart), with the keys that
  /// they asked for.
  void refuseUnknown() const;
};

}  // namespace assembly_cell
