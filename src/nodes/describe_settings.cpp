// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Writes tables and comments of settings, as declared in the code, into pages and parameter files.

#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "assembly_cell/align/parameters.h"
#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/ros/calibration/calibration_server_settings.h"
#include "assembly_cell/ros/driver/driver_settings.h"
#include "assembly_cell/ros/estimation/locus_node.h"
#include "assembly_cell/ros/estimation/twin_force_node.h"
#include "assembly_cell/ros/records/recorder_node.h"
#include "assembly_cell/ros/records/run_recorder.h"
#include "assembly_cell/ros/simulation/cell_player.h"
#include "assembly_cell/ros/simulation/markers/marker_settings.h"
#include "assembly_cell/ros/simulation/report_program.h"
#include "assembly_cell/ros/simulation/simulated_rig_node.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"
#include "assembly_cell/ros/supervision/identifier_node.h"
#include "assembly_cell/ros/supervision/known_mechanism.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/shaker/guarded_shaker.h"
#include "assembly_cell/study/study.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: describe_settings FILE... [options]

Writes the settings that the code declares into pages (.md: a table) and parameter files (.yaml: keys with defaults and
comments), between the lines "settings NAME" and "end of settings" in a comment. NAME:
  as parameters of a node: align, arm_bridge, calibration_server, driver, emulated_arm, exciter_output, identifier, locus,
    markers, mechanism, plant, player, record, recorder, report, rig, simulator, source, twin_force;
  as keys: calibration_maps, scenario, study.

  --check               write nothing: refuse a file that differs from the code
  --help                print this

Exit code: 0 ok, 1 a file differs (--check), 2 bad input.

Example: describe_settings docs/reference/nodes/assembly_supervisor.md config/supervisor.yaml
)";

// The maps of parameters of the calibration server.
struct CalibrationMaps {
  SensorDescription sensor_a;
  ReferenceAccuracy accuracy;
  RatedLoad rated;
};

void fields(FieldList& f, CalibrationMaps& maps) {
  f.section("sensor_a", maps.sensor_a);
  f.section("accuracy", maps.accuracy);
  f.section("rated", maps.rated);
}

template <class Settings>
std::string describe(bool parameters, bool markdown) {
  Settings settings;
  const FieldList list = fieldsOf(settings);
  return markdown ? fieldTable(list, parameters) : commentedParameters(list);
}

struct Described {
  const char* name;
  std::string (*describe)(bool parameters, bool markdown);
  bool parameters;  // of a node, or keys of a file
};

const Described kDescribed[] = {
    {"align", describe<AlignParameters>, true},
    {"arm_bridge", describe<BridgeSettings>, true},
    {"calibration_maps", describe<CalibrationMaps>, false},
    {"calibration_server", describe<ros_bridge::CalibrationServerSettings>, true},
    {"driver", describe<ros_bridge::DriverSettings>, true},
    {"emulated_arm", describe<EmulatedArmSettings>, true},
    {"exciter_output", describe<ShakerLimits>, true},
    {"identifier", describe<ros_bridge::IdentifierSettings>, true},
    {"locus", describe<ros_bridge::LocusSettings>, true},
    {"markers", describe<ros_bridge::MarkerSettings>, true},
    {"mechanism", describe<ros_bridge::MechanismSettings>, true},
    {"plant", describe<ros_bridge::PlantSettings>, true},
    {"player", describe<ros_bridge::PlayerSettings>, true},
    {"record", describe<ros_bridge::RecordSettings>, true},
    {"recorder", describe<ros_bridge::RecorderSettings>, true},
    {"report", describe<ros_bridge::ReportSettings>, true},
    {"rig", describe<ros_bridge::RigNodeSettings>, true},
    {"scenario", describe<Scenario>, false},
    {"simulator", describe<ros_bridge::SimulatorSettings>, true},
    {"source", describe<ros_bridge::SourceSettings>, true},
    {"study", describe<StudyJob>, false},
    {"twin_force", describe<ros_bridge::TwinForceNodeSettings>, true},
};

std::string describe(const std::string& name, bool markdown, const std::string& where) {
  std::string known;
  for (const Described& described : kDescribed) {
    if (name == described.name) return described.describe(described.parameters, markdown);
    known += (known.empty() ? "" : ", ") + std::string(described.name);
  }
  throw InputError(where + ": settings " + name + ": unknown, known are " + known);
}

// What a line's comment says: "settings align" of "<!-- settings align -->" or "# settings align".
std::string comment(const std::string& line) {
  for (const std::string& mark : {std::string("<!-- "), std::string("# ")}) {
    if (line.compare(0, mark.size(), mark) != 0) continue;
    const std::size_t end = line.find(" -->");
    return line.substr(mark.size(), end == std::string::npos ? end : end - mark.size());
  }
  return {};
}

std::string rewritten(const std::string& text, const std::string& path) {
  const bool markdown = path.size() > 3 && path.compare(path.size() - 3, 3, ".md") == 0;
  const std::string begin = "settings ";
  std::istringstream in(text);
  std::string out, line;
  bool inside = false;
  while (std::getline(in, line)) {
    const std::string what = comment(line);
    if (inside && what == "end of settings") inside = false;
    if (inside) continue;
    out += line + "\n";
    if (what.compare(0, begin.size(), begin) != 0) continue;
    inside = true;
    out += describe(what.substr(begin.size()), markdown, path);
  }
  if (inside) throw InputError(path + ": settings: no end, add a comment \"end of settings\"");
  return out;
}

std::string contentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw InputError(path + ": can't be read: give a page or a parameter file");
  return text.str();
}

int run(const std::vector<std::string>& arguments) {
  std::vector<std::string> files;
  bool check = false;
  OptionParser parser(kHelp);
  parser.files("file", files);
  parser.flag("--check", check);
  if (!parser.parse(arguments)) return 0;
  int code = 0;
  for (const std::string& path : files) {
    const std::string before = contentOf(path), after = rewritten(before, path);
    if (before == after) continue;
    if (!check) {
      writeFileAtomically(path, after, path);
      continue;
    }
    code = 1;
    std::cerr << path << " differs from the code: run describe_settings " << path << "\n";
  }
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  return assembly_cell::runTool("describe_settings", argc, argv, run);
}
