// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Records of assemblies: list, show, check, compare.

#include <iostream>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "records/commands.h"

using namespace assembly_cell;

namespace {

constexpr const char* kHelp =
    R"(Usage: records COMMAND [options]      records COMMAND --help lists them

Records of assemblies in a store, one SQLite file, see docs/reference/records.md. Commands:

)";
constexpr const char* kHelpEnd = R"(
  --store FILE    of all commands (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)

Exit code: 0 ok, 1 refused by a check, 2 bad input.

Example: align config/scenarios/cell.yaml --insert 0.03 --record runs.db && records show 1 --store runs.db
)";

struct Command {
  const char* name;
  const char* summary;
  int (*run)(const std::vector<std::string>& arguments);
};
constexpr Command kCommands[] = {
    {"list", "runs, the latest first", listRuns},
    {"show", "one run as YAML", showRun},
    {"export", "the curve of one run, or a list of runs, as CSV", exportRuns},
    {"trend", "a quantity over the runs", trendOfRuns},
    {"plot", "a picture of the curve of one run", plotRun},
    {"compare", "a picture of the curves of several runs", compareRuns},
    {"learn", "a band that curves of good runs stay in", learnRules},
    {"judge", "what boxes and bands state of runs", evaluateRuns},
    {"report", "runs, curves and trends as a page for a browser", reportRuns},
    {"import", "curves of others into the store", importRuns},
    {"check", "integrity of the store", checkStore},
};

int run(const std::vector<std::string>& arguments) {
  std::string names;
  for (const Command& command : kCommands)
    names += (names.empty() ? "" : ", ") + std::string(command.name);
  if (arguments.empty()) throw InputError("command missing: give one of " + names + ", see --help");
  if (arguments[0] == "--help" || arguments[0] == "-h") {
    std::cout << kHelp;
    for (const Command& command : kCommands) {
      std::cout << "  " << command.name << std::string(10 - std::string(command.name).size(), ' ')
                << command.summary << "\n";
    }
    std::cout << kHelpEnd;
    return 0;
  }
  for (const Command& command : kCommands) {
    if (arguments[0] == command.name) return command.run({arguments.begin() + 1, arguments.end()});
  }
  throw InputError("command is '" + arguments[0] + "': give one of " + names + ", see --help");
}

}  // namespace

int main(int argc, char** argv) { return runTool("records", argc, argv, run); }
