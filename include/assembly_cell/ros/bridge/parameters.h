// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <yaml-cpp/yaml.h>

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "assembly_cell/base/fields.h"

namespace assembly_cell::ros_bridge {

constexpr Range kAny = Range::kAny, kNotNegative = Range::kNotNegative,
                kPositive = Range::kPositive;

/// Reads the parameters of a node handle's namespace (for private ones, give NodeHandle("~")). A
/// parameter is required when it has no fallback. Missing, of the wrong type, not finite or out of
/// range: InputError, one line with the resolved name, the value and what to do.
class Parameters {
 public:
  explicit Parameters(const ros::NodeHandle& nh) : nh_(nh) {}

  double number(const std::string& name, const Range& range,
                std::optional<double> fallback = std::nullopt);
  int integer(const std::string& name, int min, int max,
              std::optional<int> fallback = std::nullopt);
  bool flag(const std::string& name, std::optional<bool> fallback = std::nullopt);
  std::string text(const std::string& name, std::optional<std::string> fallback = std::nullopt);
  /// One of `choices`.
  std::string choice(const std::string& name, const std::vector<std::string>& choices,
                     std::optional<std::string> fallback = std::nullopt);
  /// A list of strings (also accepted: one string, which is a list of one; "" is empty).
  std::vector<std::string> texts(const std::string& name,
                                 std::optional<std::vector<std::string>> fallback = std::nullopt);
  /// A list of `size` finite numbers.
  std::vector<double> numbers(const std::string& name, std::size_t size,
                              std::optional<std::vector<double>> fallback = std::nullopt);

  /// All fields of a struct, by their paths with '_' between the parts. What is missing keeps its
  /// value, unless it is required.
  void read(const FieldList& fields);

  /// A map of values of any kind, for a reader with rules of its own; an empty one where it's
  /// missing.
  YAML::Node tree(const std::string& name);
  /// Marks a parameter as known: it is read elsewhere.
  void markKnown(const std::string& name) { known_.insert(name); }
  /// Parameters that were read so far.
  const std::set<std::string>& known() const { return known_; }
  /// Is `name` a map?
  bool isTree(const std::string& name) const;

  /// Throws InputError for the first parameter of the namespace that none of the calls above has
  /// read and that is not in `others`: a misspelt name must not become a default. Also for a
  /// parameter of the node that its command line gives without the underscore: that renames a
  /// topic.
  void refuseUnknown(const std::set<std::string>& others = {}) const;

 private:
  void refuseRenamed() const;
  std::optional<XmlRpc::XmlRpcValue> find(const std::string& name, bool required);

  ros::NodeHandle nh_;
  std::set<std::string> known_;
};

}  // namespace assembly_cell::ros_bridge
