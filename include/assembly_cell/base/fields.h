// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/base/range.h"

// Settings declared once. Beside a struct that people set stands one function
//
//   void fields(FieldList& f, AlignParameters& p) {
//     f.number("settle", p.settle, notNegative("s", 60), "Time at rest before a measurement.");
//     f.section("insert", p.insert);
//   }
//
// and from its list come the readers of YAML (yaml::Section::read), of ROS parameters
// (ros_bridge::Parameters::read) and of key=value (setField), live settings, the writer, comments
// and tables. Defaults are those of the struct. Checks that involve several fields are functions.
namespace assembly_cell {

namespace yaml {
class Section;
}

/// A member of a struct: where it is, by which name a person sets it, and what it may be.
struct Field {
  enum class Kind { kNumber, kNumbers, kInteger, kFlag, kText, kChoice, kSection, kOther };
  /// When a node takes a change: at its start only, while it runs, or while it runs and never
  /// above the value at the start.
  enum class Change { kRestart, kLive, kLower };

  std::string path;  ///< "insert.force"
  Kind kind;
  Range range;              ///< of a number, of each of a row, of an integer
  const char* description;  ///< a sentence, a literal

  double* numbers = nullptr;  ///< of a number or a row of `count`
  double* against = nullptr;  ///< of a number that may be a vector: see orVector()
  std::size_t count = 1;      ///< of a section: of the fields after it that are in it, at any depth
  bool* flag = nullptr;
  std::string* text = nullptr;
  // of an integer its value, of a choice the index in `names`
  std::function<std::int64_t()> get;
  std::function<void(std::int64_t)> set;
  std::vector<std::string> names;  ///< of a choice
  /// For kOther, which only a file has: reads the key `name()` of a section.
  std::function<void(yaml::Section&)> read;

  const char* entries = nullptr;  ///< of a row: what its numbers are, in words; null: not said
  const char* origin = nullptr;   ///< of a default that depends on others: in words, else null
  bool is_required = false;       ///< a file or a node's parameters must have it
  const char* unless = nullptr;   ///< of a required one: the key that may take its place
  bool is_independent = false;    ///< no other field and no check depends on it
  bool is_written = true;         ///< into a file
  bool is_flow = false;           ///< written on one line
  Change change = Change::kRestart;

  Field& required(bool is = true);
  /// Required unless the same section has this key, a literal.
  Field& requiredUnless(const char* other);
  /// The default depends on other parameters or on the node: in words, a literal.
  Field& derived(const char* from);
  /// What the numbers of a row are, a literal for refusals.
  Field& row(const char* of);
  Field& independent();
  /// A number that may be given as a vector, three numbers: its length, against `direction`, a unit
  /// vector. A number alone leaves the direction.
  Field& orVector(double* direction);
  /// False, and nothing changed: its length is out of range.
  bool setVector(const double* vector) const;
  /// Left out of a written file when false: the default says the same.
  Field& written(bool is);
  Field& flow();
  Field& live(Change when = Change::kLive);

  /// Last part of the path.
  std::string name() const;
  /// The value in YAML.
  std::string value() const;
  /// What to give: "give a number from 0 to 60 [s]".
  std::string remedy() const;
  /// Parses a value in YAML. False, and nothing changed: it is none for this field.
  bool parse(const std::string& text) const;
};

/// Fields in the order of their declaration. They refer to the struct's members.
class FieldList {
 public:
  Field& number(const char* name, double& value, const Range& range, const char* description);
  /// A row of `count` numbers.
  Field& numbers(const char* name, double* values, std::size_t count, const Range& range,
                 const char* description);
  Field& flag(const char* name, bool& value, const char* description);
  Field& text(const char* name, std::string& value, const char* description);
  template <class Integer>
  Field& integer(const char* name, Integer& value, std::int64_t low, std::int64_t high,
                 const char* description, const char* unit = "") {
    Field& field = indexed(
        name, Field::Kind::kInteger, [&value] { return static_cast<std::int64_t>(value); },
        [&value](std::int64_t to) { value = static_cast<Integer>(to); }, description);
    field.range = {static_cast<double>(low), static_cast<double>(high), unit};
    return field;
  }
  /// An enumeration that counts from 0; `names` in its order.
  template <class Enum>
  Field& choice(const char* name, Enum& value, std::vector<std::string> names,
                const char* description) {
    Field& field = indexed(
        name, Field::Kind::kChoice, [&value] { return static_cast<std::int64_t>(value); },
        [&value](std::int64_t to) { value = static_cast<Enum>(to); }, description);
    field.names = std::move(names);
    return field;
  }
  /// A text that is one of `names`.
  Field& choice(const char* name, std::string& value, std::vector<std::string> names,
                const char* description);
  /// A value of any other form, read by a function.
  Field& other(const char* name, std::function<void(yaml::Section&)> read,
               const char* description = "");
  /// A struct within the struct: calls its function fields().
  template <class Struct>
  Field& section(const char* name, Struct& value, const char* description = "") {
    return group(
        name, [&](FieldList& f) { fields(f, value); }, description);
  }
  /// Fields under a name of their own that are no struct.
  Field& group(const char* name, const std::function<void(FieldList&)>& list,
               const char* description = "");

  std::deque<Field>::const_iterator begin() const { return fields_.begin(); }
  std::deque<Field>::const_iterator end() const { return fields_.end(); }
  /// Null for an unknown path.
  const Field* find(const std::string& path) const;
  /// "settle, window, insert.force", without sections.
  std::string names() const;

 private:
  Field& add(const char* name, Field::Kind kind, const Range& range, const char* description);
  Field& indexed(const char* name, Field::Kind kind, std::function<std::int64_t()> get,
                 std::function<void(std::int64_t)> set, const char* description);

  std::string prefix_;
  std::deque<Field> fields_;  // references stay valid
};

template <class Struct>
FieldList fieldsOf(Struct& value) {
  FieldList list;
  fields(list, value);
  return list;
}

/// Sets the field of a path from a text. Throws KeyError for an unknown path, InputError for a
/// value that is none: "PATH: value VALUE: give ...".
void setField(const FieldList& fields, const std::string& path, const std::string& text);
/// Sets a field from "PATH=VALUE".
void setField(const FieldList& fields, const std::string& assignment);

/// Throws InputError for the first number out of its range: "PATH: value VALUE: give ...".
void checkFields(const FieldList& fields);

/// The values as keys of a YAML mapping, each line after `indent` blanks.
std::string yamlText(const FieldList& fields, std::size_t indent = 0);

/// The same with the descriptions as comments, names of sections joined by '_': parameters of a
/// node. What has no default of its own is a comment. Each line after `indent` blanks.
std::string commentedParameters(const FieldList& fields, std::size_t indent = 0);

/// Rows of a Markdown table: name, default, range, description. `parameters`: names as a node's
/// private parameters, sections joined by '_'.
std::string fieldTable(const FieldList& fields, bool parameters);

/// A path as a node's parameter: "insert.force" is "insert_force".
std::string parameterName(const std::string& path);

}  // namespace assembly_cell
