// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the tools over tables of closed forms share: a flat YAML file of parameters, one of them
// swept, results as YAML and CSV.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/math/closed_form.h"

namespace assembly_cell {

using Names = std::vector<std::string>;

constexpr std::size_t kMaxPoints = 10000000;  // of a map or a list of values: 1 GB of CSV
constexpr const char* kValues = "give a list 1,2,5 or FIRST:LAST:COUNT";

/// The flat mapping of a file, each key read by its kind or refused.
class Parameters {
 public:
  explicit Parameters(const std::string& file);

  void set(const std::string& key, double value) { values_[key] = value; }
  bool has(const std::string& key) const { return values_.count(key) || in_.has(key); }
  /// Exactly the keys of a form, apart from those that it can do without.
  void expect(const ClosedForm& form) const;
  /// What a form reads, each by its kind.
  ModelParameters read(const ClosedForm& form);
  std::string word(const std::string& key) { return in_.text(key, "give a word"); }

 private:
  std::vector<double> valuesOf(const std::string& key);
  double number(const std::string& key);
  double whole(const std::string& key);
  std::vector<double> matrix(const std::string& key);

  std::string file_;
  yaml::Section in_;
  std::map<std::string, double> values_;
};

/// One key of the file at these values.
struct Sweep {
  std::string key;
  std::vector<double> values;
};

/// A list 1,2,5 or FIRST:LAST:COUNT.
bool parseValues(const std::string& given, std::vector<double>& values);
/// Throws InputError for a second key.
bool parseSweep(const std::string& key, const std::string& list, Sweep& to);
void addSweep(OptionParser& parser, Sweep& to);  ///< --sweep KEY=VALUES

/// A result as cells: one, two of a complex number, or those of a list.
struct Column {
  std::string name;
  Names cells;
  bool list = false;
};
using Columns = std::vector<Column>;

Columns evaluate(const ClosedForm& form, const ModelParameters& parameters);
/// Results of every value of the sweep: lists for YAML, with complex numbers as pairs, and columns
/// for CSV, with complex numbers as two.
void evaluate(const ClosedForm& form, Parameters& p, const Sweep& sweep, Columns& lists,
              Columns& columns);

std::string yamlOf(const Columns& results);
/// Columns of equal length, header first; null is an empty cell.
std::string csvOf(const Columns& columns);
void writeOutput(const std::string& file, const std::string& content);

}  // namespace assembly_cell
