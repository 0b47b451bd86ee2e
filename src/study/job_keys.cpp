// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/study/study.h"

namespace assembly_cell {
namespace {

struct JobNumber {
  const char* key;
  double& (*of)(StudyJob&);
  double least, most;
};
constexpr double kAny = std::numeric_limits<double>::max();

const JobNumber kNumbers[] = {
    {"start.x", [](StudyJob& j) -> double& { return j.start.x; }, -1, 1},
    {"start.y", [](StudyJob& j) -> double& { return j.start.y; }, -1, 1},
    {"start.offset", [](StudyJob& j) -> double& { return j.start.offset; }, -1, 1},
    {"start.azimuth", [](StudyJob& j) -> double& { return j.start.azimuth; }, -kAny, kAny},
    {"start.tilt_x", [](StudyJob& j) -> double& { return j.start.tilt_x; }, -1, 1},
    {"start.tilt_y", [](StudyJob& j) -> double& { return j.start.tilt_y; }, -1, 1},
    {"start.tilt", [](StudyJob& j) -> double& { return j.start.tilt; }, -1, 1},
    {"start.tilt_azimuth", [](StudyJob& j) -> double& { return j.start.tilt_azimuth; }, -kAny,
     kAny},
    {"start.height", [](StudyJob& j) -> double& { return j.start.height; }, 0, 1},
    {"move.x", [](StudyJob& j) -> double& { return j.move.x; }, -1, 1},
    {"move.y", [](StudyJob& j) -> double& { return j.move.y; }, -1, 1},
    {"move.z", [](StudyJob& j) -> double& { return j.move.z; }, -1, 1},
    {"move.delay", [](StudyJob& j) -> double& { return j.move.delay; }, 0, kAny},
    {"look", [](StudyJob& j) -> double& { return j.look; }, 1e-6, kAny},
    {"assembled.depth", [](StudyJob& j) -> double& { return j.assembled_depth; }, 0, 1},
    {"assembled.offset", [](StudyJob& j) -> double& { return j.assembled_offset; }, 0, 1},
    {"stop.force", [](StudyJob& j) -> double& { return j.stop_force; }, 0, kAny},
    {"stop.evaluations", [](StudyJob& j) -> double& { return j.stop_evaluations; }, 1, kAny},
    {"cell.noise", [](StudyJob& j) -> double& { return j.cell.noise; }, 0, 5},
    // ranges of align.* are those of checkParameters()
    {"align.press_force", [](StudyJob& j) -> double& { return j.align.press_force; }, -kAny, kAny},
    {"align.force_limit", [](StudyJob& j) -> double& { return j.align.force_limit; }, -kAny, kAny},
    {"align.exciter_amplitude", [](StudyJob& j) -> double& { return j.align.exciter_amplitude; },
     -kAny, kAny},
    {"align.exciter_frequency", [](StudyJob& j) -> double& { return j.align.exciter_frequency; },
     -kAny, kAny},
    {"align.settle", [](StudyJob& j) -> double& { return j.align.settle; }, -kAny, kAny},
    {"align.window", [](StudyJob& j) -> double& { return j.align.window; }, -kAny, kAny},
    {"align.sweep_tilt", [](StudyJob& j) -> double& { return j.align.sweep_tilt; }, -kAny, kAny},
    {"align.contact_force", [](StudyJob& j) -> double& { return j.align.contact_force; }, -kAny,
     kAny},
    {"align.contact_tilt", [](StudyJob& j) -> double& { return j.align.contact_tilt; }, -kAny,
     kAny},
    {"align.insertion_depth", [](StudyJob& j) -> double& { return j.align.insertion_depth; }, -kAny,
     kAny},
    {"align.insertion_force", [](StudyJob& j) -> double& { return j.align.insertion_force; }, -kAny,
     kAny},
};

struct JobInteger {
  const char* key;
  int& (*of)(StudyJob&);
};
const JobInteger kIntegers[] = {
    {"cell.bits", [](StudyJob& j) -> int& { return j.cell.bits; }},
    {"align.sweep_readings", [](StudyJob& j) -> int& { return j.align.sweep_readings; }},
    {"align.rounds", [](StudyJob& j) -> int& { return j.align.rounds; }},
    {"align.fewest_contacts", [](StudyJob& j) -> int& { return j.align.fewest_contacts; }},
    {"align.most_contacts", [](StudyJob& j) -> int& { return j.align.most_contacts; }},
};

[[noreturn]] void refuse(const StudySetting& s, const std::string& remedy) {
  throw InputError(s.key + ": value " + s.value + ": " + remedy);
}

}  // namespace

bool setStudyJob(StudyJob& job, const StudySetting& s) {
  const std::string section = s.key.substr(0, s.key.find('.'));
  const std::string sections[] = {"start", "move", "look", "assembled", "stop", "cell", "align"};
  if (std::find(std::begin(sections), std::end(sections), section) == std::end(sections)) {
    return false;
  }
  const bool align = job.kind == StudyJob::Kind::kAlign;
  if (section != "start" && (section == "cell" || section == "align") != align) {
    refuse(s, align ? "of no use with job: align, leave it out" : "needs job: align");
  }
  if (section == "start") job.start.given = true;
  if (section == "move") job.move.given = true;

  if (s.key == "align.strategy") {
    AlignParameters probe;
    probe.strategy = s.value;
    checkParameters(probe);
    job.align.strategy = s.value;
    return true;
  }
  if (s.key == "stop.assembled") {
    if (s.value != "true" && s.value != "false") refuse(s, "give true or false");
    job.stop_assembled = s.value == "true";
    return true;
  }
  for (const JobNumber& number : kNumbers) {
    if (s.key != number.key) continue;
    double value = 0.0;
    if (!parseNumber(s.value, value)) refuse(s, "give a finite number");
    if (value < number.least || value > number.most) {
      refuse(s, "give a number from " + yamlNumber(number.least) +
                    (number.most < kAny ? " to " + yamlNumber(number.most) : " on"));
    }
    number.of(job) = value;
    return true;
  }
  for (const JobInteger& integer : kIntegers) {
    if (s.key != integer.key) continue;
    double value = 0.0;
    if (!parseNumber(s.value, value) || value != std::round(value) || std::abs(value) > 1e9) {
      refuse(s, "give a whole number");
    }
    integer.of(job) = static_cast<int>(value);
    return true;
  }
  std::string known;
  const auto add = [&](const std::string& key) {
    if (key.compare(0, section.size(), section) == 0) known += (known.empty() ? "" : ", ") + key;
  };
  for (const JobNumber& number : kNumbers) add(number.key);
  for (const JobInteger& integer : kIntegers) add(integer.key);
  add("stop.assembled");
  add("align.strategy");
  refuse(s, "unknown key, known here: " + known);
}

double* scenarioNumber(Scenario& s, const std::string& key, bool* alone) {
  struct Number {
    const char* key;
    double& (*of)(Scenario&);
    bool alone;
  };
  static const Number kScenario[] = {
      {"duration", [](Scenario& c) -> double& { return c.duration; }, true},
      {"gravity", [](Scenario& c) -> double& { return c.mechanism.gravity; }, true},
      {"peg.radius", [](Scenario& c) -> double& { return c.mechanism.peg.radius; }, true},
      {"peg.mass", [](Scenario& c) -> double& { return c.mechanism.peg.mass; }, true},
      {"peg.inertia_transverse",
       [](Scenario& c) -> double& { return c.mechanism.peg.inertia_transverse; }, false},
      {"peg.inertia_axial", [](Scenario& c) -> double& { return c.mechanism.peg.inertia_axial; },
       false},
      {"peg.exciter_height", [](Scenario& c) -> double& { return c.mechanism.peg.exciter_height; },
       true},
      {"hole.radius", [](Scenario& c) -> double& { return c.mechanism.hole.radius; }, true},
      {"carrier.mass", [](Scenario& c) -> double& { return c.mechanism.carrier.mass; }, true},
      {"carrier.inertia", [](Scenario& c) -> double& { return c.mechanism.carrier.inertia; }, true},
      {"carrier.max_speed", [](Scenario& c) -> double& { return c.mechanism.carrier.max_speed; },
       true},
      {"coupling.rest.z", [](Scenario& c) -> double& { return c.rest.z; }, false},
      {"coupling.stiffness.k26",
       [](Scenario& c) -> double& { return c.mechanism.coupling.stiffness.k26; }, false},
      {"coupling.stiffness.k35",
       [](Scenario& c) -> double& { return c.mechanism.coupling.stiffness.k35; }, false},
      {"coupling.damping.c26",
       [](Scenario& c) -> double& { return c.mechanism.coupling.damping.k26; }, false},
      {"coupling.damping.c35",
       [](Scenario& c) -> double& { return c.mechanism.coupling.damping.k35; }, false},
      {"exciter.amplitude", [](Scenario& c) -> double& { return c.mechanism.exciter.amplitude; },
       true},
      {"exciter.frequency", [](Scenario& c) -> double& { return c.mechanism.exciter.frequency; },
       true},
      {"exciter.phase", [](Scenario& c) -> double& { return c.mechanism.exciter.phase; }, true},
      {"friction.static",
       [](Scenario& c) -> double& { return c.mechanism.friction.static_coefficient; }, false},
      {"friction.sliding",
       [](Scenario& c) -> double& { return c.mechanism.friction.sliding_coefficient; }, false},
      {"contact.rate", [](Scenario& c) -> double& { return c.contact.rate; }, true},
      {"solver.tolerance", [](Scenario& c) -> double& { return c.solver.tolerance; }, true},
      {"solver.max_step", [](Scenario& c) -> double& { return c.solver.max_step; }, true},
  };
  for (const Number& number : kScenario) {
    if (key != number.key) continue;
    if (alone != nullptr) *alone = number.alone;
    return &number.of(s);
  }
  if (alone != nullptr) *alone = false;
  // entries of lists
  struct List {
    const char* key;
    double* first;
    int size;
  };
  const List lists[] = {
      {"coupling.stiffness.diagonal", s.mechanism.coupling.stiffness.diagonal.data(), 6},
      {"coupling.damping.diagonal", s.mechanism.coupling.damping.diagonal.data(), 6},
      {"carrier.stiffness", s.mechanism.carrier.stiffness.data(), 3},
      {"carrier.damping", s.mechanism.carrier.damping.data(), 3},
      {"push", s.push.data(), 3},
      {"initial.peg.position", s.initial.position.data(), 3},
  };
  for (const List& list : lists) {
    for (int i = 0; i < list.size; ++i) {
      if (key == std::string(list.key) + "[" + std::to_string(i) + "]") return list.first + i;
    }
  }
  return nullptr;
}

}  // namespace assembly_cell
