// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "study_check.h"

#include <algorithm>
#include <set>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell::study_file {
namespace {

bool admitted(const Study& study, const StudySetting& s) {
  for (std::size_t i = 0; i < study.texts.size(); ++i) {
    try {
      parseScenario(study.texts[i], study.scenarios[i], {s.key + "=" + s.value});
    } catch (const InputError&) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string nameOf(yaml::Section& in, const char* remedy) {
  std::string name = in.text("name", remedy);
  std::replace_if(
      name.begin(), name.end(),
      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, ' ');
  if (trimmed(name).empty()) in.refuse(in.at("name"), "\"" + name + "\"", remedy);
  return name;
}

void checkCount(const Study& study, const std::string& path) {
  double count = static_cast<double>(study.samples);
  for (const StudyAxis& a : study.axes) {
    if (a.grid()) count *= static_cast<double>(a.size());
  }
  double points = study.search.outcome.empty() ? 1.0 : 0.0;
  for (const StudySearch::Step& step : study.search.steps) points += step.evaluations;
  count *= points;
  if (count > static_cast<double>(kMaxRuns)) {
    yaml::refuse(path, "samples", yaml::shown(count) + " runs", "give at most 1e8 runs in all");
  }
}

void checkAlign(const AlignParameters& parameters) {
  try {
    checkParameters(parameters);
  } catch (const InputError& e) {
    throw InputError(std::string("align.") + e.what());
  }
}

void loadScenarios(Study& study, const std::string& path) {
  std::vector<std::string> overrides;
  for (const StudySetting& s : study.set) {
    StudyJob copy = study.job;
    if (s.key == "scenario") yaml::refuse(path, "set.scenario", s.value, "use the key scenario");
    if (!setStudyJob(copy, s)) overrides.push_back(s.key + "=" + s.value);
    study.job = copy;
  }
  for (const std::string& file : study.scenarios) {
    within(path, "scenario", [&] {
      study.texts.push_back(yaml::fileText(file, "scenario"));
      const std::string& text = study.texts.back();
      study.digests.push_back(crcText(text));
      study.bases.push_back(parseScenario(text, file, overrides));
    });
  }
}

void checkKeys(Study& study, const std::string& path) {
  StudyTask task;
  task.point.assign(study.axes.size(), 0.5);
  std::vector<StudySetting> all = studyRun(study, task).settings;
  for (const StudyAxis& a : study.axes) {
    for (const auto& one : a.cases) all.insert(all.end(), one.begin(), one.end());
  }
  std::set<std::string> seen;
  for (const StudySetting& s : all) {
    StudyJob job = study.job;
    if (s.key.rfind("assembled.", 0) == 0) study.evaluated = true;
    if (!seen.insert(s.key).second || s.key == "scenario") continue;
    try {
      if (setStudyJob(job, s)) continue;
      parseScenario(study.texts.front(), "scenario", {s.key + "=" + s.value});
    } catch (const KeyError& e) {
      throw InputError(path + ": axes: " + e.what());
    } catch (const InputError&) {
      // a value out of range is the matter of the runs that have it
    }
  }
}

void findDirectKeys(Study& study) {
  for (const StudyAxis& a : study.axes) {
    std::vector<StudySetting> ends;
    for (const auto& one : a.cases) ends.insert(ends.end(), one.begin(), one.end());
    std::vector<double> numbers = a.values;
    if (a.kind == StudyAxis::Kind::kUniform || a.kind == StudyAxis::Kind::kLogUniform ||
        a.kind == StudyAxis::Kind::kSearch) {
      numbers = {a.low, a.high};
    }
    for (const StudyAxis::Target& target : a.targets) {
      if (target.power != 0.0) continue;
      for (const double number : numbers) ends.push_back({target.key, yamlNumber(number)});
    }
    std::set<std::string> keys, bad;
    for (const StudySetting& s : ends) {
      Scenario scratch = study.bases.front();
      bool independent = false;
      double value = 0.0;
      const bool number = scenarioNumber(scratch, s.key, &independent) != nullptr;
      if (!number || !independent || !parseNumber(s.value, value) || !admitted(study, s))
        bad.insert(s.key);
      keys.insert(s.key);
    }
    for (const std::string& key : keys) {
      if (bad.count(key) == 0) study.direct.push_back(key);
    }
  }
}

}  // namespace assembly_cell::study_file
