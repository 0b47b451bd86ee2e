// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Prints the URDF of a scenario's cell.

#include <yaml-cpp/yaml.h>

#include <iostream>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/description/urdf_text.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: cell_urdf SCENARIO.yaml [options]

Prints the URDF of the cell that a scenario describes: peg, hole block, coupling, carrier and both sensors with
geometry, masses and inertias. cell.launch makes its robot_description so.

  --set KEY.PATH=VALUE  change a value of the scenario; repeatable
  --overrides LIST      the same as a YAML list, as the launch files have it
  --help                print this

Exit code: 0 ok, 2 bad input.

Example: cell_urdf config/scenarios/cell.yaml --set hole.radius=0.02502
)";

std::vector<std::string> listOf(const std::string& yaml) {
  try {
    return YAML::Load(yaml).as<std::vector<std::string>>();
  } catch (const YAML::Exception&) {
    throw InputError("--overrides: value " + yaml +
                     ": give a YAML list of KEY.PATH=VALUE, [] for none");
  }
}

int run(const std::vector<std::string>& arguments) {
  std::string scenario, list = "[]";
  std::vector<std::string> overrides;
  OptionParser parser(kHelp);
  parser.file("scenario file", scenario);
  parser.texts("--set", overrides);
  parser.text("--overrides", list);
  if (!parser.parse(arguments)) return 0;
  const std::vector<std::string> more = listOf(list);
  overrides.insert(overrides.end(), more.begin(), more.end());
  const Mechanism mechanism = loadMechanism(scenario, overrides);
  const std::string urdf = cellUrdf(mechanism);
  // parts that no URDF can describe are refused here
  checkAgainst(loadCellDescription(urdf, scenario), mechanism, scenario);
  std::cout << urdf << std::flush;
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("cell_urdf", argc, argv, run); }
