// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <ctime>
#include <iostream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/records/import.h"
#include "commands.h"
#include "run_source.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp =
    R"(Usage: records import PATH... --program P [options]

Curves of others into the store, one run each. PATH: a CSV file, gzipped or not, or a folder. Columns: depth or t, or
both; axial (also force, fz); lateral, or fx and fy; moment, or tx and ty; tilt; in SI, or in the unit that a header
names. A column run makes a curve of each row of equal numbers. A folder may have the files of the snap_fit recordings:
NN_R_Torques.dat[.gz], with NN_R_State.dat and NN_R_CartPos.dat where they are there.

  --program P            name of the assembly program, as in rules and filters
  --result R             result of these runs: seated, failed or a word of your own (seated)
  --station S            where (imported)
  --time-unit U          of t: s, ms, us or ns (default auto)
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Exit code: 0 ok, 2 bad input: then no run of these files is stored.

Example: records import press/*.csv --program bushing --result seated
)";

}  // namespace

int importRuns(const std::vector<std::string>& arguments) {
  std::vector<std::string> paths;
  std::string program, result = "seated", station = "imported";
  TimeUnit unit = TimeUnit::kFound;
  OptionParser parser(kHelp);
  parser.files("curves", paths);
  parser.text("--program", program);
  parser.text("--result", result);
  parser.text("--station", station);
  parser.choice("--time-unit", unit, kTimeUnitChoices);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  if (program.empty())
    throw InputError("--program: missing: give the name of the assembly program");
  std::vector<Run> runs = readCurves(paths, unit);
  RunStore opened = store.open(RunStore::Access::kWrite);
  const auto now = static_cast<double>(std::time(nullptr));
  for (Run& run : runs) {
    run.program = program;
    run.result = result;
    run.station = station;
    if (run.start == 0.0) run.start = now;
    opened.append(run);
  }
  std::cout << "imported: " << runs.size() << "\nfirst: " << runs.front().id
            << "\nlast: " << runs.back().id << "\nstore: " << store.path() << "\n";
  return 0;
}

}  // namespace assembly_cell
