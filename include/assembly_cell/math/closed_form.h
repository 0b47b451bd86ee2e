// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <complex>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace assembly_cell {

// Closed forms as a table: name, parameters, results, function. Each module has its own table; a
// tool evaluates it from a flat YAML file.

/// Values of parameters by name; a matrix row by row.
struct ModelParameters {
  std::map<std::string, std::vector<double>> values;

  bool has(const std::string& name) const { return values.count(name) > 0; }
  /// One number; throws InputError where it is missing.
  double operator()(const std::string& name) const;
  double operator()(const std::string& name, double otherwise) const;
};

/// Kind of a parameter, the same in all models.
enum class ParameterKind { kNumber, kWhole, kFlag, kMatrix, kWord };
ParameterKind parameterKind(const std::string& name);

/// Empty: undefined for this valid input.
using ModelValue = std::variant<double, std::optional<double>, std::optional<int>, bool,
                                const char*, std::complex<double>, std::vector<double>>;

struct ClosedForm {
  const char* name;
  const char* required;  ///< names separated by a blank
  const char* spare;     ///< names that the file may have without effect
  const char* optional;
  const char* results;
  std::vector<ModelValue> (*evaluate)(const ModelParameters&);  ///< one value a result
};

/// By name, null where there is none.
template <std::size_t N>
const ClosedForm* findForm(const ClosedForm (&table)[N], const std::string& name) {
  const auto at = std::find_if(std::begin(table), std::end(table),
                               [&](const ClosedForm& form) { return form.name == name; });
  return at == std::end(table) ? nullptr : at;
}

}  // namespace assembly_cell
