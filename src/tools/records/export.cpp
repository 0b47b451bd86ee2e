// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <iostream>
#include <memory>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "commands.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp = R"(Usage: records export [N] [options]

CSV of the curve of run N: time [s], depth [m], axial and lateral force [N], moment [N m], tilt [rad]; channels that
were not measured are left out. Without N: a row a run, the latest first.

)";
constexpr const char* kHelpEnd = R"(  --limit N              the latest N of them; 0 (default): all
  --output FILE.csv      instead of standard output
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records export 17 --output curve.csv
)";

// Empty for what isn't there.
std::string cell(double value) { return std::isnan(value) ? "" : yamlNumber(value); }

std::string listText(const std::vector<RunSummary>& runs) {
  std::string text =
      "run,start,duration,serial,program,station,strategy,result,failure,peak_force,seating_depth,"
      "verdicts,failed\n";
  for (const RunSummary& run : runs) {
    text += std::to_string(run.id) + "," + yamlNumber(run.start) + "," + yamlNumber(run.duration);
    for (const std::string& one :
         {run.serial, run.program, run.station, run.strategy, run.result, run.failure}) {
      text += "," + csvCell(one);
    }
    text += "," + cell(run.peak_force) + "," + cell(run.seating_depth) + "," +
            std::to_string(run.verdicts) + "," + std::to_string(run.failed) + "\n";
  }
  return text;
}

}  // namespace

std::string curveText(const Curve& curve) {
  std::vector<CurveChannel> measured;
  std::string text;
  for (const CurveChannel& channel : kCurveChannels) {
    const std::vector<double>& values = curve.*channel.values;
    if (!values.empty() && std::isnan(values.front())) continue;
    text += (measured.empty() ? "" : ",") + std::string(channel.name);
    measured.push_back(channel);
  }
  text += "\n";
  for (std::size_t i = 0; i < curve.size(); ++i) {
    for (std::size_t k = 0; k < measured.size(); ++k) {
      text += (k == 0 ? "" : ",") + yamlNumber((curve.*measured[k].values)[i]);
    }
    text += "\n";
  }
  return text;
}

int exportRuns(const std::vector<std::string>& arguments) {
  std::string number, output;
  OptionParser parser(std::string(kHelp) + kFilterHelp + kHelpEnd);
  parser.file("number of a run", number, false);
  const FilterOptions options(parser, 0);
  parser.text("--output", output);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  if (!number.empty()) parser.notWith("a run", kFilterOptions);
  const std::string text = number.empty() ? listText(store.open().list(options.filter()))
                                          : curveText(store.open().read(runNumber(number)).curve);
  if (output.empty()) {
    std::cout << text;
    return 0;
  }
  NewFile file(output, "--output: value " + output, "give a file that can be written");
  file.write(text);
  file.finish();
  return 0;
}

}  // namespace assembly_cell
