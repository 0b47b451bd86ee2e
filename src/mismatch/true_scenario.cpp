// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario_numbers.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;
using yaml::shown;

// of `scale`: the true hole's radius is the true peg's and so many drawn clearances
constexpr const char* kClearance = "clearance";

std::string shownValues(const std::vector<double>& values) {
  if (values.size() == 1) return shown(values.front());
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + shown(value);
  return "[" + text + "]";
}

bool isMatrix(const std::string& path) {
  return path == "coupling.stiffness" || path == "coupling.damping";
}

// diagonal by its factors, the cross terms with the root of their rows' factors
void scaleMatrix(const DrawnChange& change, CouplingMatrix& matrix) {
  scaleRows(matrix, change.each ? Vector6(Vector6::Map(change.values.data()))
                                : Vector6(Vector6::Constant(change.values.front())));
}

// inertias go with the mass of their part
void scaleInertias(const std::string& path, double factor, Mechanism& m) {
  if (path == "peg.mass") {
    m.peg.inertia_transverse *= factor;
    m.peg.inertia_axial *= factor;
  } else if (path == "carrier.mass") {
    m.carrier.inertia *= factor;
  }
}

std::vector<ScenarioNumber> numbersOf(const DrawnChange& change, Scenario& s) {
  if (change.path == kClearance) return scenarioNumbers(s, "hole.radius");
  if (change.path != "friction") return scenarioNumbers(s, change.path);
  FrictionParameters& friction = s.mechanism.friction;
  const Range range = Range::kNotNegative;
  return {{"friction.static", &friction.static_coefficient, range, false},
          {"friction.sliding", &friction.sliding_coefficient, range, false}};
}

void scale(const DrawnChange& change, Scenario& s) {
  if (change.path == kClearance) return;  // last, with the true peg
  CouplingParameters& coupling = s.mechanism.coupling;
  if (isMatrix(change.path)) {
    return scaleMatrix(change,
                       change.path == "coupling.stiffness" ? coupling.stiffness : coupling.damping);
  }
  const std::vector<ScenarioNumber> numbers = numbersOf(change, s);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    *numbers[i].value *= change.values[change.each ? i : 0];
  }
  scaleInertias(change.path, change.values.front(), s.mechanism);
}

// a hole without end stays so
bool possible(double value, const Range& range) {
  return range.contains(value) || value == HUGE_VAL;
}

// The hole about the true peg; refuses in every run what another run of the file could draw.
void scaleClearance(const DrawnChange& change, const Mechanism& nominal, const std::string& source,
                    Scenario& s) {
  const double clearance = nominal.hole.radius - nominal.peg.radius;
  const double peg = s.mechanism.peg.radius;
  if (!(clearance > 0.0)) {
    yaml::refuse(source, "scale.clearance", shownValues(change.values),
                 "the scenario draws no clearance to scale: hole.radius is " +
                     shown(nominal.hole.radius) + ", peg.radius " + shown(nominal.peg.radius));
  }
  for (const double factor : {change.low, change.high}) {
    const double radius = peg + factor * clearance;
    if (change.low == change.high) continue;
    if (scenarioNumbers(s, "hole.radius").front().range.contains(radius)) continue;
    yaml::refuse(source, "scale.clearance",
                 "[" + shown(change.low) + ", " + shown(change.high) + "]",
                 "can be drawn (normal draws within 5 SD), but the true hole.radius would be " +
                     shown(radius) + ", give a narrower draw");
  }
  s.mechanism.hole.radius = peg + change.values.front() * clearance;
}

// Refuses in every run what another run of the file could draw.
void checkReach(const DrawnChange& change, const ScenarioNumber& number,
                const std::string& source) {
  for (const double by : {change.low, change.high}) {
    const double value = *number.value + by;
    if (change.low == change.high || possible(value, number.range)) continue;
    yaml::refuse(source, "add." + change.key,
                 "[" + shown(change.low) + ", " + shown(change.high) + "]",
                 "can be drawn (normal draws within 5 SD), but the true " + number.key +
                     " would be " + shown(value) + ", give a narrower draw");
  }
}

void add(const DrawnChange& change, const std::string& source, Scenario& s) {
  const std::vector<ScenarioNumber> numbers = numbersOf(change, s);
  for (const ScenarioNumber& number : numbers) checkReach(change, number, source);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double before = *numbers[i].value;
    *numbers[i].value += change.values[change.each ? i : 0];
    if (before > 0.0) scaleInertias(change.path, *numbers[i].value / before, s.mechanism);
  }
}

// ---- what a scenario file would be refused for

// refuses by the last entry of the file that concerns the key
[[noreturn]] void refuseDraw(const Truth& truth, const std::string& source,
                             const MechanismProblem& problem) {
  std::string section, key, drawn;
  const std::string part = problem.key.substr(0, problem.key.find('.'));
  const auto look = [&](const std::vector<DrawnChange>& changes, const std::string& name) {
    for (const DrawnChange& change : changes) {
      const std::string path = change.path == kClearance ? "hole.radius" : change.path;
      if (path.compare(0, part.size(), part) != 0) continue;
      section = name;
      key = change.key;
      drawn = shownValues(change.values);
    }
  };
  look(truth.scale, "scale");
  look(truth.add, "add");
  yaml::refuse(source, section + "." + key, drawn,
               "drawn, but the true " + problem.key + " would be " + shown(problem.value) + " (" +
                   problem.why + "), give a narrower draw");
}

void checkNumbers(const Truth& truth, const std::string& source, Scenario& s) {
  for (const auto* changes : {&truth.scale, &truth.add}) {
    for (const DrawnChange& change : *changes) {
      const std::vector<ScenarioNumber> numbers =
          isMatrix(change.path) ? scenarioNumbers(s, change.path + ".diagonal")
                                : numbersOf(change, s);
      for (const ScenarioNumber& number : numbers) {
        const double value = *number.value;
        if (possible(value, number.range)) continue;
        yaml::refuse(source, (changes == &truth.scale ? "scale." : "add.") + change.key,
                     shownValues(change.values),
                     "drawn, but the true " + number.key + " would be " + shown(value) +
                         ", give a narrower draw");
      }
    }
  }
  auto problem = problemOf(s.mechanism);
  if (!problem) problem = problemOfTheta("coupling.rest.theta", s.rest.theta);
  if (!problem) problem = problemOfTheta("initial.peg.euler[1]", s.initial.euler.theta);
  if (problem) refuseDraw(truth, source, *problem);
}

// ---- where the peg starts

// everything that starts turns by R about the peg's bottom centre
void turnStart(const Eigen::Matrix3d& R, Scenario& s) {
  InitialState& start = s.initial;
  const Eigen::Matrix3d peg = rotationFromEuler(start.euler);
  const Vector3d bottom = start.position - s.mechanism.peg.half_height * peg.col(2);
  const auto turned = [&](const RestPose& rest) {
    const Pose X = poseFromRest(rest);
    return restFromPose({R * X.R, bottom + R * (X.p - bottom)});
  };
  RestPose carrier = s.rest;
  carrier.x = start.carrier_x;
  carrier.y = start.carrier_y;
  carrier.yaw = start.carrier_yaw;
  carrier = turned(carrier);
  start.carrier_x = carrier.x;
  start.carrier_y = carrier.y;
  start.carrier_yaw = carrier.yaw;
  s.rest = turned(s.rest);
  start.position = bottom + R * (start.position - bottom);
  start.euler = eulerFromRotation(R * peg);
  start.velocity = R * start.velocity;
}

}  // namespace

Scenario trueScenario(const Scenario& nominal, const Truth& truth, const std::string& source) {
  Scenario s = nominal;
  s.imperfections = truth.imperfections;
  s.mechanism.peg.radius_tolerance = s.mechanism.hole.radius_tolerance = kNoTolerance;
  if (!truth.scale.empty() || !truth.add.empty()) {
    for (const DrawnChange& change : truth.scale) scale(change, s);
    for (const DrawnChange& change : truth.add) add(change, source, s);
    for (const DrawnChange& change : truth.scale) {
      if (change.path == kClearance) scaleClearance(change, nominal.mechanism, source, s);
    }
    checkNumbers(truth, source, s);
    const double longer = s.mechanism.peg.coupling_height - nominal.mechanism.peg.coupling_height;
    if (longer != 0.0) s.initial.position -= longer * rotationFromEuler(s.initial.euler).col(2);
  }
  if (!truth.face_tilt.isZero(0.0)) {
    // the block turns against the base, so the base against the block
    const Vector3d turn(-truth.face_tilt.x(), -truth.face_tilt.y(), 0.0);
    turnStart(rotationFromVector({turn}), s);
  }
  return s;
}

}  // namespace assembly_cell
