// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace assembly_cell::yaml {

/// What a YAML file is, recognised by keys that only its kind has. A scenario is a mechanism, too.
enum class FileKind {
  kAny,
  kScenario,
  kMechanism,
  kMismatch,
  kCalibration,
  kObservations,
  kStudy,
  kContacts,
  kPlace,
  kArm,
  kArmBridge,
  kEmulatedArm,
  kRules,
  kNode
};

/// Refuses what is plainly of another kind than `wanted`, with one line that names both.
void refuseOtherKind(const YAML::Node& root, FileKind wanted, const std::string& source);

/// Refuses a file of XML where one of YAML is wanted.
void refuseXml(const std::string& text, FileKind wanted, const std::string& source);

}  // namespace assembly_cell::yaml
