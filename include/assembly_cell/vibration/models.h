// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/walking.h"

namespace assembly_cell {

// The closed forms of this folder as a table: name, parameters, results, function.

/// Values of parameters by name; a matrix row by row.
struct ModelParameters {
  std::map<std::string, std::vector<double>> values;

  bool has(const std::string& name) const { return values.count(name) > 0; }
  /// One number; throws InputError where it is missing.
  double operator()(const std::string& name) const;
  double operator()(const std::string& name, double otherwise) const;
};

/// A name is of one kind in all models.
enum class ParameterKind { kNumber, kWhole, kFlag, kMatrix, kWord };
ParameterKind parameterKind(const std::string& name);

/// What is undefined inside valid input is empty.
using ModelValue = std::variant<double, std::optional<double>, std::optional<int>, bool,
                                const char*, std::complex<double>, std::vector<double>>;

struct VibrationModel {
  const char* name;
  const char* required;  ///< names, one blank between
  const char* spare;     ///< what its file may hold without being read
  const char* optional;
  const char* results;
  std::vector<ModelValue> (*evaluate)(const ModelParameters&);  ///< one value a result
};

/// By name, null where there is none. `locus` has the parameter `model` alone, which names one of
/// the table of locusModel (`isotropic`, ...); `map` is evaluated by designCase and designPoint.
const VibrationModel* vibrationModel(const std::string& name);
const VibrationModel* locusModel(const std::string& name);

DesignCase designCase(const ModelParameters& p);  ///< of `map`
WalkCase walkCase(const ModelParameters& p);      ///< of `walk`

}  // namespace assembly_cell
