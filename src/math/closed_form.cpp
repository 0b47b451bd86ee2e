// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/closed_form.h"

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

double ModelParameters::operator()(const std::string& name) const {
  if (!has(name)) throw InputError(name + ": missing, give a number");
  return values.at(name).front();
}

double ModelParameters::operator()(const std::string& name, double otherwise) const {
  return has(name) ? (*this)(name) : otherwise;
}

ParameterKind parameterKind(const std::string& name) {
  if (name == "model") return ParameterKind::kWord;
  if (name == "K6" || name == "C6") return ParameterKind::kMatrix;
  if (name == "cycles") return ParameterKind::kWhole;
  return name == "inertia" ? ParameterKind::kFlag : ParameterKind::kNumber;
}

}  // namespace assembly_cell
