// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace YAML {
class Node;
}

namespace assembly_cell {

/// Reads the YAML map of a StrainSource. A key without a fallback is required. Missing, of the
/// wrong type, not finite or out of range: InputError, one line with the source, the key, its value
/// and what to do.
class SourceParameters {
 public:
  /// `map` outlives this; null counts as empty. `subject` begins messages, as "source netft".
  /// Throws InputError for anything but a map.
  SourceParameters(const YAML::Node& map, std::string subject);

  double number(const std::string& key, double min, double max,
                std::optional<double> fallback = std::nullopt);
  int integer(const std::string& key, int min, int max, std::optional<int> fallback = std::nullopt);
  bool flag(const std::string& key, std::optional<bool> fallback = std::nullopt);
  /// At most 1024 characters, printable.
  std::string text(const std::string& key, std::optional<std::string> fallback = std::nullopt);
  /// One of `choices`.
  std::string choice(const std::string& key, const std::vector<std::string>& choices,
                     std::optional<std::string> fallback = std::nullopt);
  std::vector<std::string> texts(const std::string& key,
                                 std::optional<std::vector<std::string>> fallback = std::nullopt);
  /// A list of `size` finite numbers.
  std::vector<double> numbers(const std::string& key, std::size_t size,
                              std::optional<std::vector<double>> fallback = std::nullopt);
  bool has(const std::string& key) const;

  /// Throws for a key that none of the calls above has asked for (`type` apart), with the keys that
  /// they asked for.
  void refuseUnknown() const;

 private:
  YAML::Node find(const std::string& key, bool required);
  [[noreturn]] void refuse(const std::string& key, const std::string& value,
                           const std::string& remedy) const;

  const YAML::Node& map_;
  std::string subject_;
  std::vector<std::string> asked_;
};

/// `text` on one line: controls become blanks, bytes beyond ASCII question marks, more than
/// `longest` characters are cut off. For whatever a device or a file says.
std::string printable(const std::string& text, std::size_t longest = 80);

}  // namespace assembly_cell
