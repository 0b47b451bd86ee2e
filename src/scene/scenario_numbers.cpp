// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario_numbers.h"

#include "assembly_cell/base/fields.h"

namespace assembly_cell {
namespace {

// Tolerances are of the drawing, and the arm's response is a measurement: no part of a simulation
// has one.
bool isNumber(const Field& field) {
  if (field.name() == "radius_tolerance" || field.path.rfind("arm.", 0) == 0) return false;
  return field.kind == Field::Kind::kNumber || field.kind == Field::Kind::kNumbers;
}

}  // namespace

std::vector<ScenarioNumber> scenarioNumbers(Scenario& scenario, const std::string& key) {
  std::vector<ScenarioNumber> found;
  for (const Field& field : fieldsOf(scenario)) {
    if (!isNumber(field) || key.compare(0, field.path.size(), field.path) != 0) continue;
    if (field.kind == Field::Kind::kNumber) {
      if (key == field.path) return {{key, field.numbers, field.range, field.is_independent}};
      continue;
    }
    for (std::size_t i = 0; i < field.count; ++i) {
      const ScenarioNumber number{field.path + "[" + std::to_string(i) + "]", field.numbers + i,
                                  field.range, field.is_independent};
      if (key == number.key) return {number};
      found.push_back(number);
    }
    if (key == field.path) return found;
    found.clear();
  }
  return {};
}

double* scenarioNumber(Scenario& scenario, const std::string& key, bool* independent) {
  const std::vector<ScenarioNumber> found = scenarioNumbers(scenario, key);
  const bool one = found.size() == 1 && found.front().key == key;
  if (independent != nullptr) *independent = one && found.front().independent;
  return one ? found.front().value : nullptr;
}

std::string scenarioNumberNames() {
  Scenario scenario;
  std::string names;
  for (const Field& field : fieldsOf(scenario)) {
    if (isNumber(field)) names += (names.empty() ? "" : ", ") + field.path;
  }
  return names;
}

}  // namespace assembly_cell
