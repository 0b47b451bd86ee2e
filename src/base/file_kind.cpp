// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/file_kind.h"

#include <algorithm>
#include <vector>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell::yaml {

namespace {

using Keys = std::vector<const char*>;

struct Kind {
  FileKind kind;
  const char* name;
  const char* like;  // one that the package has, or what makes one
  Keys all;          // on top of each file of this kind
  Keys any;          // where all are optional: one of them is there
};

// the first that fits is meant: calibrations have observations, these have sensors as mismatches
// have
const Kind kKinds[] = {
    {FileKind::kScenario,
     "a scenario",
     "such as config/scenarios/cell.yaml",
     {"peg", "coupling", "contact"},
     {}},
    {FileKind::kMechanism,
     "a mechanism",
     "that of a scenario such as config/scenarios/cell.yaml, or one that identify writes",
     {"peg", "coupling", "identification"},
     {}},
    {FileKind::kCalibration,
     "a calibration",
     "such as config/calibration/sensor_b.yaml",
     {"volts_to_wrench"},
     {}},
    {FileKind::kObservations,
     "a file of observations",
     "such as calibrate plan writes",
     {"format", "observations"},
     {}},
    {FileKind::kStudy, "a study", "such as config/studies/sliding.yaml", {"scenario", "axes"}, {}},
    {FileKind::kContacts,
     "a file of contacts",
     "such as config/contacts/peg_on_rim.yaml",
     {"contacts"},
     {}},
    {FileKind::kPlace,
     "the place of a cell before an arm",
     "such as config/arm/cell_place.yaml",
     {"flange", "hole_in_base"},
     {}},
    {FileKind::kArm,
     "an arm with its bridge",
     "such as config/arm/emulated.yaml",
     {"urdf", "place", "bridge"},
     {}},
    {FileKind::kArmBridge,
     "parameters of arm_bridge",
     "such as config/arm/arm_bridge.yaml",
     {},
     {"max_following", "max_raw_force", "following_time", "saturated_time"}},
    {FileKind::kEmulatedArm,
     "parameters of emulate_arm",
     "such as config/arm/emulate_arm.yaml",
     {},
     {"latency", "encoder_step", "repeatability", "protective_force"}},
    {FileKind::kNode,
     "the parameters of a force_sensor_driver",
     "such as config/sensor_a.yaml",
     {"source", "frame_id"},
     {}},
    {FileKind::kNode,
     "the parameters of a node",
     "such as config/supervisor.yaml",
     {},
     {"accelerometer_noise", "identify_time", "direction_limit", "use_displacement", "lifetime",
      "gauge_half_distance"}},
    {FileKind::kRules,
     "rules for records",
     "such as records learn writes, see docs/reference/files.md",
     {"rules", "program"},
     {}},
    {FileKind::kMismatch,
     "a mismatch",
     "such as config/mismatch/level_1.yaml",
     {},
     {"scale", "add", "sensor_a", "sensor_b"}}};

const Kind* kindOf(const YAML::Node& root) {
  const auto has = [&](const char* key) { return root[key].IsDefined(); };
  for (const Kind& one : kKinds) {
    if (std::all_of(one.all.begin(), one.all.end(), has) &&
        (one.any.empty() || std::any_of(one.any.begin(), one.any.end(), has))) {
      return &one;
    }
  }
  return nullptr;
}

const Kind* find(FileKind kind) {
  for (const Kind& one : kKinds) {
    if (one.kind == kind) return &one;
  }
  return nullptr;
}

[[noreturn]] void refuseAs(const std::string& is, const Kind& wanted, const std::string& source) {
  throw InputError(source + ": this looks like " + is + ": give " + wanted.name + " here, " +
                   wanted.like);
}

}  // namespace

void refuseOtherKind(const YAML::Node& root, FileKind wanted, const std::string& source) {
  const Kind* one = find(wanted);
  if (one == nullptr || !root.IsMap()) return;
  const Kind* is = kindOf(root);
  const bool good = is == nullptr || is == one ||
                    (wanted == FileKind::kMechanism && is->kind == FileKind::kScenario);
  if (!good) refuseAs(is->name, *one, source);
}

void refuseXml(const std::string& text, FileKind wanted, const std::string& source) {
  const Kind* one = find(wanted);
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (one == nullptr || begin == std::string::npos || text[begin] != '<') return;
  refuseAs("XML, as a URDF or a launch file is", *one, source);
}

}  // namespace assembly_cell::yaml
