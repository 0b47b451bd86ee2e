// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include "assembly_cell/base/text.h"
#include "commands.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp = R"(Usage: records list [options]

Runs, the latest first: number, start, serial, program, result with its failure, duration [s], largest axial force [N],
depth at the end [mm], and how many of its verdicts passed.

)";
constexpr const char* kHelpEnd =
    R"(  --limit N              the latest N of them (default 50); 0: all
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records list --program plate --from 2026-11-29 --failed
)";

constexpr std::size_t kWidest = 40;  // characters of a column
using Row = std::array<std::string, 9>;

std::string number(const char* format, double value) {
  return std::isnan(value) ? "-" : text(format, value);
}

Row rowOf(const RunSummary& run) {
  const int passed = run.verdicts - run.failed;
  return {std::to_string(run.id),
          timeText(run.start),
          printable(run.serial, kWidest),
          printable(run.program, kWidest),
          printable(run.result + (run.failure.empty() ? "" : ": " + run.failure), kWidest),
          text("%.2f", run.duration),
          number("%.1f", run.peak_force),
          number("%.2f", 1e3 * run.seating_depth),
          run.verdicts == 0 ? "-" : text("%d of %d", passed, run.verdicts)};
}

}  // namespace

int listRuns(const std::vector<std::string>& arguments) {
  OptionParser parser(std::string(kHelp) + kFilterHelp + kHelpEnd);
  const FilterOptions options(parser, 50);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;

  std::vector<Row> rows{
      {"run", "start", "serial", "program", "result", "time", "force", "depth", "verdicts"}};
  for (const RunSummary& run : store.open().list(options.filter())) rows.push_back(rowOf(run));
  std::array<std::size_t, std::tuple_size_v<Row>> widths{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i] + std::string(i + 1 < row.size() ? widths[i] + 2 - row[i].size() : 0, ' ');
    }
    std::cout << line << "\n";
  }
  return 0;
}

}  // namespace assembly_cell
