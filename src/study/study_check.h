// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/study/study.h"

// What a study refers to, once its own file is read.
namespace assembly_cell::study_file {

/// Does something; an error gets the study's place in front.
template <class Do>
void within(const std::string& path, const std::string& where, const Do& what) {
  try {
    what();
  } catch (const InputError& e) {
    throw InputError(path + ": " + (where.empty() ? "" : where + ": ") + e.what());
  }
}

/// The key `name`: something to be seen, on one line.
std::string nameOf(yaml::Section& in, const char* remedy);

constexpr std::int64_t kMaxRuns = 100000000;

/// Refuses more than kMaxRuns.
void checkCount(const Study& study, const std::string& path);
/// checkParameters(), whose refusals name the study's keys: align.*.
void checkAlign(const AlignParameters& parameters);
/// Reads the scenarios, with `set`.
void loadScenarios(Study& study, const std::string& path);
/// Refuses keys that don't exist: they would make every run fail alike.
void checkKeys(Study& study, const std::string& path);
/// Numbers whose extremes the parser admits need no parser in between: study.direct.
void findDirectKeys(Study& study);

}  // namespace assembly_cell::study_file
