// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario_numbers.h"

namespace assembly_cell {
namespace {

using yaml::Range;

struct Entry {
  const char* key;
  double* first;
  Range range;
  bool alone;
  int size;  // 0: a number, else that of a list
};

std::vector<Entry> mechanismEntries(Mechanism& m) {
  constexpr Range any = Range::kAny, not_negative = Range::kNotNegative,
                  positive = Range::kPositive;
  return {
      {"gravity", &m.gravity, not_negative, true, 0},
      {"peg.radius", &m.peg.radius, positive, true, 0},
      {"peg.half_height", &m.peg.half_height, positive, false, 0},
      {"peg.mass", &m.peg.mass, positive, true, 0},
      {"peg.inertia_transverse", &m.peg.inertia_transverse, positive, false, 0},
      {"peg.inertia_axial", &m.peg.inertia_axial, positive, false, 0},
      {"peg.coupling_height", &m.peg.coupling_height, any, false, 0},
      {"peg.exciter_height", &m.peg.exciter_height, any, true, 0},
      {"peg.chamfer.width", &m.peg.chamfer_width, not_negative, false, 0},
      {"peg.chamfer.angle", &m.peg.chamfer_angle, positive, false, 0},
      {"hole.radius", &m.hole.radius, positive, true, 0},
      {"hole.depth", &m.hole.depth, positive, false, 0},
      {"hole.chamfer.width", &m.hole.chamfer_width, not_negative, false, 0},
      {"hole.chamfer.angle", &m.hole.chamfer_angle, positive, false, 0},
      {"carrier.mass", &m.carrier.mass, positive, true, 0},
      {"carrier.inertia", &m.carrier.inertia, positive, true, 0},
      {"carrier.stiffness", m.carrier.stiffness.data(), not_negative, false, 3},
      {"carrier.damping", m.carrier.damping.data(), not_negative, false, 3},
      {"carrier.max_speed", &m.carrier.max_speed, positive, true, 0},
      {"carrier.max_acceleration", &m.carrier.max_acceleration, positive, false, 0},
      {"coupling.stiffness.diagonal", m.coupling.stiffness.diagonal.data(), not_negative, false, 6},
      {"coupling.stiffness.k26", &m.coupling.stiffness.k26, any, false, 0},
      {"coupling.stiffness.k35", &m.coupling.stiffness.k35, any, false, 0},
      {"coupling.damping.diagonal", m.coupling.damping.diagonal.data(), not_negative, false, 6},
      {"coupling.damping.c26", &m.coupling.damping.k26, any, false, 0},
      {"coupling.damping.c35", &m.coupling.damping.k35, any, false, 0},
      {"exciter.amplitude", &m.exciter.amplitude, not_negative, true, 0},
      {"exciter.frequency", &m.exciter.frequency, not_negative, true, 0},
      {"exciter.phase", &m.exciter.phase, any, true, 0},
      {"friction.static", &m.friction.static_coefficient, not_negative, false, 0},
      {"friction.sliding", &m.friction.sliding_coefficient, not_negative, false, 0},
  };
}

std::vector<Entry> entriesOf(Scenario& s) {
  constexpr Range any = Range::kAny, not_negative = Range::kNotNegative,
                  positive = Range::kPositive;
  std::vector<Entry> entries = mechanismEntries(s.mechanism);
  const Entry others[] = {
      {"duration", &s.duration, not_negative, true, 0},
      {"carrier.rest.x", &s.rest.x, any, false, 0},
      {"carrier.rest.y", &s.rest.y, any, false, 0},
      {"carrier.rest.yaw", &s.rest.yaw, any, false, 0},
      {"coupling.rest.z", &s.rest.z, any, false, 0},
      {"coupling.rest.theta", &s.rest.theta, any, false, 0},
      {"coupling.rest.phi", &s.rest.phi, any, false, 0},
      {"push", s.push.data(), any, false, 3},
      {"contact.rate", &s.contact.rate, not_negative, true, 0},
      {"contact.pull_back", &s.contact.pull_back, not_negative, false, 0},
      {"contact.stiffness", &s.contact.stiffness, not_negative, false, 0},
      {"contact.damping", &s.contact.damping, not_negative, false, 0},
      {"contact.restitution", &s.contact.restitution, not_negative, false, 0},
      {"contact.regularisation_speed", &s.contact.regularisation_speed, positive, false, 0},
      {"initial.peg.position", s.initial.position.data(), any, false, 3},
      {"solver.tolerance", &s.solver.tolerance, positive, true, 0},
      {"solver.max_step", &s.solver.max_step, positive, true, 0},
  };
  entries.insert(entries.end(), std::begin(others), std::end(others));
  return entries;
}

}  // namespace

std::vector<ScenarioNumber> scenarioNumbers(Scenario& scenario, const std::string& key) {
  std::vector<ScenarioNumber> found;
  for (const Entry& entry : entriesOf(scenario)) {
    const std::string name = entry.key;
    if (key.compare(0, name.size(), name) != 0) continue;
    if (entry.size == 0) {
      if (key == name) return {{name, entry.first, entry.range, entry.alone}};
      continue;
    }
    for (int i = 0; i < entry.size; ++i) {
      const ScenarioNumber number{name + "[" + std::to_string(i) + "]", entry.first + i,
                                  entry.range, entry.alone};
      if (key == number.key) return {number};
      found.push_back(number);
    }
    if (key == name) return found;
    found.clear();
  }
  return {};
}

double* scenarioNumber(Scenario& scenario, const std::string& key, bool* alone) {
  const std::vector<ScenarioNumber> found = scenarioNumbers(scenario, key);
  const bool one = found.size() == 1 && found.front().key == key;
  if (alone != nullptr) *alone = one && found.front().alone;
  return one ? found.front().value : nullptr;
}

std::string scenarioNumberNames() {
  Scenario scenario;
  std::string names;
  for (const Entry& entry : entriesOf(scenario)) {
    names += (names.empty() ? "" : ", ") + std::string(entry.key);
  }
  return names;
}

}  // namespace assembly_cell
