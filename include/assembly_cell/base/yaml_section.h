// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/file_kind.h"

// Files that people write, read key by key: every refusal is one line that names the source, the
// key's path, the value and the remedy.
namespace assembly_cell::yaml {

[[noreturn]] void refuse(const std::string& source, const std::string& path,
                         const std::string& value, const std::string& remedy);

std::string shown(double value);
/// The node's text, shortened to fit a line.
std::string shown(const YAML::Node& node);

/// Number in YAML's notation without octal, hexadecimal, .inf, .nan or quotes.
bool readNumber(const YAML::Node& node, double& value);

using assembly_cell::Range;

/// Wording of refusals: "peg.mass: value -1: give ..." or "peg.mass is '-1': give
/// ...".
enum class Wording { kValue, kIs };

/// A mapping of the file that is read key by key; finish() refuses keys that were not read.
class Section {
 public:
  Section(const YAML::Node& node, std::string path, std::string source,
          Wording wording = Wording::kValue);

  /// Path of a key, or of the section itself for an empty one.
  std::string at(const std::string& key) const;
  bool has(const std::string& key) const { return find(key) != nullptr; }
  std::vector<std::string> keys() const;
  const std::string& source() const { return source_; }

  [[noreturn]] void refuse(const std::string& path, const std::string& value,
                           const std::string& what_to_do) const;
  [[noreturn]] void refuse(const std::string& path, double value,
                           const std::string& what_to_do) const;

  /// The node of a key that must be there.
  YAML::Node required(const std::string& key, const std::string& what_to_do);
  /// Marks a key as known; true when the file has it.
  bool optional(const std::string& key);
  /// Marks these keys as known and refuses all others.
  void only(std::initializer_list<const char*> keys);

  Section section(const std::string& key);
  /// A list of mappings.
  std::vector<Section> sections(const std::string& key);
  double number(const std::string& key, const Range& range,
                std::optional<double> otherwise = std::nullopt);
  /// Bounds included; without `otherwise` the key must be there.
  double number(const std::string& key, double low, double high,
                std::optional<double> otherwise = std::nullopt);
  std::int64_t integer(const std::string& key, std::int64_t low, std::int64_t high,
                       std::optional<std::int64_t> otherwise = std::nullopt);
  template <int N>
  Eigen::Matrix<double, N, 1> numbers(const std::string& key, const Range& range) {
    Eigen::Matrix<double, N, 1> values;
    readNumbers(key, range, N, values.data());
    return values;
  }
  std::vector<double> numbers(const std::string& key, std::size_t count);
  Eigen::Vector3d vector(const std::string& key);
  std::string text(const std::string& key, const std::string& what_to_do);
  /// One of `choices`.
  std::string choice(const std::string& key, const std::vector<std::string>& choices,
                     const std::optional<std::string>& otherwise = std::nullopt);
  /// A list of scalars.
  std::vector<std::string> texts(const std::string& key);
  bool flag(const std::string& key, bool otherwise);

  /// Reads all fields, those of nested sections from mappings of their own, in which unknown keys
  /// are refused. What may be missing and is keeps its value. Throws InputError.
  void read(const FieldList& fields);

  void finish() const;

 protected:
  const std::vector<std::string>& known() const { return known_; }

 private:
  [[noreturn]] void refuseKey(const std::string& key, const std::string& value,
                              const std::string& what_to_do, const std::string& is) const;
  const YAML::Node* find(const std::string& key) const;
  void know(const std::string& key);
  void readField(const Field& field);
  void readFields(std::deque<Field>::const_iterator at, std::deque<Field>::const_iterator end);
  /// `of`: what the numbers are, in words; null: not said.
  void readNumbers(const std::string& key, const Range& range, int count, double* values,
                   const char* of = nullptr);

  std::string path_;
  std::string source_;
  Wording wording_;
  std::vector<std::pair<std::string, YAML::Node>> entries_;
  std::vector<std::string> known_;
};

/// The text of a file of at most `largest` bytes; `what` it should be ("scenario") for the refusal
/// of others.
std::string fileText(const std::string& path, const std::string& what,
                     std::size_t largest = 1 << 20);

/// The first document of the text; syntax errors, further documents and another kind of file than
/// `wanted` are refused.
YAML::Node loadYaml(const std::string& text, const std::string& source,
                    FileKind wanted = FileKind::kAny);

/// The tree after an override "key.path=value", the value in YAML syntax. Copies the nodes
/// on the path, so that a node shared through a YAML alias changes in one place only.
YAML::Node withOverride(const YAML::Node& root, const std::string& text);

/// A mapping of keys with overrides applied.
YAML::Node loadMapping(const std::string& text, const std::string& source,
                       const std::vector<std::string>& overrides, FileKind wanted);

}  // namespace assembly_cell::yaml
