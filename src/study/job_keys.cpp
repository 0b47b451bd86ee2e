// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/study/study.h"
#include "study_check.h"

namespace assembly_cell {
namespace {

struct JobNumber {
  const char* key;
  double* value;
  double min, max;
};
constexpr double kAny = std::numeric_limits<double>::max();

std::vector<JobNumber> numbersOf(StudyJob& j) {
  return {
      {"start.x", &j.start.x, -1, 1},
      {"start.y", &j.start.y, -1, 1},
      {"start.offset", &j.start.offset, -1, 1},
      {"start.azimuth", &j.start.azimuth, -kAny, kAny},
      {"start.tilt_x", &j.start.tilt_x, -1, 1},
      {"start.tilt_y", &j.start.tilt_y, -1, 1},
      {"start.tilt", &j.start.tilt, -1, 1},
      {"start.tilt_azimuth", &j.start.tilt_azimuth, -kAny, kAny},
      {"start.height", &j.start.height, 0, 1},
      {"move.x", &j.move.x, -1, 1},
      {"move.y", &j.move.y, -1, 1},
      {"move.z", &j.move.z, -1, 1},
      {"move.delay", &j.move.delay, 0, kAny},
      {"look", &j.look, 1e-6, kAny},
      {"assembled.depth", &j.assembled_depth, 0, 1},
      {"assembled.offset", &j.assembled_offset, 0, 1},
      {"stop.force", &j.stop_force, 0, kAny},
      {"stop.evaluations", &j.stop_evaluations, 1, kAny},
      {"cell.noise", &j.cell.noise, 0, 5},
      // ranges of align.* are those of checkParameters()
      {"align.press_force", &j.align.press_force, -kAny, kAny},
      {"align.force_limit", &j.align.force_limit, -kAny, kAny},
      {"align.exciter_amplitude", &j.align.exciter_amplitude, -kAny, kAny},
      {"align.exciter_frequency", &j.align.exciter_frequency, -kAny, kAny},
      {"align.settle", &j.align.settle, -kAny, kAny},
      {"align.window", &j.align.window, -kAny, kAny},
      {"align.sweep_tilt", &j.align.sweep_tilt, -kAny, kAny},
      {"align.contact_force", &j.align.contact_force, -kAny, kAny},
      {"align.contact_tilt", &j.align.contact_tilt, -kAny, kAny},
      {"align.insertion_depth", &j.align.insertion_depth, -kAny, kAny},
      {"align.insertion_force", &j.align.insertion_force, -kAny, kAny},
  };
}

struct JobInteger {
  const char* key;
  int* value;
};

std::vector<JobInteger> integersOf(StudyJob& j) {
  return {
      {"cell.bits", &j.cell.bits},
      {"align.sweep_readings", &j.align.sweep_readings},
      {"align.rounds", &j.align.rounds},
      {"align.fewest_contacts", &j.align.fewest_contacts},
      {"align.most_contacts", &j.align.most_contacts},
  };
}

std::string refusal(const StudySetting& s, const std::string& remedy) {
  return s.key + ": value " + s.value + ": " + remedy;
}

[[noreturn]] void refuse(const StudySetting& s, const std::string& remedy) {
  throw InputError(refusal(s, remedy));
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
    throw KeyError(
        refusal(s, align ? "of no use with job: align, leave it out" : "needs job: align"));
  }
  if (section == "start") job.start.given = true;
  if (section == "move") job.move.given = true;

  if (s.key == "align.strategy") {
    AlignParameters probe;
    probe.strategy = s.value;
    study_file::checkAlign(probe);
    job.align.strategy = s.value;
    return true;
  }
  if (s.key == "stop.assembled") {
    if (s.value != "true" && s.value != "false") refuse(s, "give true or false");
    job.stop_assembled = s.value == "true";
    return true;
  }
  for (const JobNumber& number : numbersOf(job)) {
    if (s.key != number.key) continue;
    double value = 0.0;
    if (!parseNumber(s.value, value)) refuse(s, "give a finite number");
    if (value < number.min || value > number.max) {
      refuse(s, "give a number from " + yamlNumber(number.min) +
                    (number.max < kAny ? " to " + yamlNumber(number.max) : " on"));
    }
    *number.value = value;
    return true;
  }
  for (const JobInteger& integer : integersOf(job)) {
    if (s.key != integer.key) continue;
    double value = 0.0;
    if (!parseNumber(s.value, value) || value != std::round(value) || std::abs(value) > 1e9) {
      refuse(s, "give a whole number");
    }
    *integer.value = static_cast<int>(value);
    if (integer.value == &job.cell.bits) checkBits(job.cell.bits, s.key + ": value ");
    return true;
  }
  std::string known;
  const auto add = [&](const std::string& key) {
    if (key.compare(0, section.size(), section) == 0) known += (known.empty() ? "" : ", ") + key;
  };
  for (const JobNumber& number : numbersOf(job)) add(number.key);
  for (const JobInteger& integer : integersOf(job)) add(integer.key);
  add("stop.assembled");
  add("align.strategy");
  throw KeyError(refusal(s, "unknown key, known here: " + known));
}

}  // namespace assembly_cell
