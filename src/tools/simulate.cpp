// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Runs one scenario and prints a YAML summary; the run itself goes to a CSV file.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario.h"

namespace {

using assembly_cell::ContactReport;
using assembly_cell::InputError;
using assembly_cell::RunCounts;
using assembly_cell::Scenario;
using assembly_cell::Simulation;
using assembly_cell::StopReason;
using Clock = std::chrono::steady_clock;

constexpr const char* kHelp =
    R"(Usage: simulate SCENARIO.yaml [options]

Runs a scenario and prints a YAML summary.

  --set KEY.PATH=VALUE  change a value of the scenario, also of a list: carrier.stiffness[0]=1e5; repeatable
  --integrator NAME     hamming, rk4, dopri5 or dop853; the same as --set solver.integrator=NAME
  --tolerance T         the same as --set solver.tolerance=T  [m]
  --step H              the same as --set solver.step=H, of rk4 and, if given, hamming  [s]
  --mismatch FILE.yaml  how the truth differs from the scenario, see docs/reference/mismatch.md
  --seed N              of what is drawn for it (default 1)
  --at T1,T2,...        times of the rows of the output  [s]
  --rows N              number of evenly spaced rows when --at is absent (default 201)
  --output RUN.csv      write the run, SI units, one row a time
  --help                print this

Exit code: 0 ok, 1 the run stopped before its duration (named in status), 2 bad input.

Example: simulate config/scenarios/impact.yaml --set contact.rate=1000 --output run.csv
)";

constexpr long kDefaultRows = 201;
constexpr long kMaxRows = 10000000;
constexpr long kStepsBetweenLooks = 10000;  // steps after which the clock is looked at

struct Options {
  std::string scenario;
  std::vector<std::string> overrides;
  std::vector<double> at;
  long rows = kDefaultRows;
  std::string output, mismatch;
  std::uint64_t seed = 1;
};

std::vector<double> parseTimes(const std::string& text) {
  std::vector<double> times;
  for (const std::string_view cell : assembly_cell::csvCells(text, "")) {
    const std::string item(cell);
    double time = 0.0;
    if (!assembly_cell::parseNumber(item, time) || time < 0.0) {
      throw InputError("--at: value " + item + ": give times >= 0 separated by commas");
    }
    times.push_back(time);
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  assembly_cell::OptionParser parser(kHelp);
  parser.file("scenario file", o.scenario);
  parser.texts("--set", o.overrides);
  for (const std::string name : {"integrator", "tolerance", "step"}) {
    parser.value("--" + name, "", [&o, name](const std::string& value) {
      o.overrides.push_back("solver." + name + "=" + value);
      return true;
    });
  }
  parser.value("--at", "", [&o](const std::string& value) {
    o.at = parseTimes(value);
    return true;
  });
  parser.integer("--rows", o.rows, 2, kMaxRows);
  parser.text("--output", o.output);
  parser.text("--mismatch", o.mismatch);
  parser.integer("--seed", o.seed, 0, 1L << 62);
  if (!parser.parse(arguments)) return false;
  if (parser.given("--at")) parser.notWith("--at", {"--rows"});
  return true;
}

std::vector<double> rowTimes(const Options& options, double duration) {
  if (!options.at.empty()) {
    if (options.at.back() > duration) {
      throw InputError("--at: value " + std::to_string(options.at.back()) + ": the run ends at " +
                       std::to_string(duration) + " s, stay within it or set duration");
    }
    return options.at;
  }
  if (duration == 0.0) return {0.0};
  std::vector<double> times;
  const auto last = static_cast<double>(options.rows - 1);
  for (long i = 0; i < options.rows; ++i) {
    times.push_back(duration * static_cast<double>(i) / last);
  }
  times.back() = duration;
  return times;
}

// empty for what is undefined
std::string shown(double value) {
  return std::isfinite(value) ? assembly_cell::yamlNumber(value) : "";
}

struct Column {
  std::string name;
  std::string value;  // empty: undefined
};

// Contact slots with columns: edges and plane always, those of a peg in the hole where admitted.
struct SlotColumn {
  std::string name;
  std::size_t slot;
};
// the shoulder of a chamfered peg as its edge, then its chamfer
void addShoulder(const Scenario& scenario, std::vector<SlotColumn>& columns) {
  const assembly_cell::ContactSlotMask admitted = scenario.contact.features;
  const bool both = scenario.mechanism.hole.chamfer_width > 0.0;
  const auto add = [&](const std::string& name, std::size_t slot, int count) {
    for (int i = 0; i < count; ++i) {
      const std::string place = count > 1 ? "_" + std::to_string(i) : "";
      columns.push_back({name + place, slot + static_cast<std::size_t>(i)});
    }
  };
  add("shoulder_edge", 14, 2);
  if (both) add("shoulder_low_edge", 16, 2);
  add("shoulder_plane", 18, 1);
  if (admitted & assembly_cell::kEdgeWallSlots) add("shoulder_wall", 19, 2);
  if (both && (admitted & assembly_cell::kEdgeConeSlots)) add("shoulder_cone", 21, 2);
  if (admitted & assembly_cell::kRimConeSlots) add("rim_cone", 23, 2);
  if (both && (admitted & assembly_cell::kRimConeSlots)) add("low_rim_cone", 25, 2);
}

std::vector<SlotColumn> slotColumns(const Scenario& scenario) {
  const assembly_cell::ContactSlotMask admitted = scenario.contact.features;
  std::vector<SlotColumn> columns = {{"edge_0", 0}, {"edge_1", 1}, {"plane", 2}};
  if (admitted & assembly_cell::kEdgeWallSlots)
    columns.insert(columns.end(), {{"wall_0", 3}, {"wall_1", 4}});
  if (admitted & assembly_cell::kRimSideSlots)
    columns.insert(columns.end(), {{"side_0", 5}, {"side_1", 6}});
  if (admitted & assembly_cell::kRimFaceSlots) columns.push_back({"face", 7});
  if (scenario.mechanism.hole.chamfer_width > 0.0) {
    // edge and side at the lower and upper edge of the chamfer, edge on it
    columns.insert(columns.end(), {{"low_edge_0", 8}, {"low_edge_1", 9}});
    if (admitted & assembly_cell::kEdgeConeSlots)
      columns.insert(columns.end(), {{"cone_0", 10}, {"cone_1", 11}});
    if (admitted & assembly_cell::kRimSideSlots)
      columns.insert(columns.end(), {{"mouth_0", 12}, {"mouth_1", 13}});
  }
  if (scenario.mechanism.peg.chamfer_width > 0.0) addShoulder(scenario, columns);
  return columns;
}

// One row: state, mode, energy, then force and gap of each contact slot.
std::vector<Column> rowOf(Simulation& simulation) {
  // places of x, y, z, ... in the state's order z, x, y, ...
  const struct {
    const char* name;
    int index;
  } coordinates[] = {{"x", 1},         {"y", 2},         {"z", 0},
                     {"phi", 3},       {"theta", 4},     {"psi", 5},
                     {"carrier_x", 6}, {"carrier_y", 7}, {"carrier_yaw", 8}};
  const std::vector<SlotColumn> slots = slotColumns(simulation.scenario());
  const auto contacts = simulation.contacts();

  std::vector<Column> row = {{"t", shown(simulation.time())}};
  for (const auto& c : coordinates) row.push_back({c.name, shown(simulation.state().q[c.index])});
  for (const auto& c : coordinates) {
    row.push_back({std::string(c.name) + "_rate", shown(simulation.state().v[c.index])});
  }
  std::string mode;
  for (const SlotColumn& column : slots) mode += "-sS"[contacts[column.slot].state];
  row.push_back({"mode", mode});
  row.push_back({"energy", shown(simulation.energy())});
  for (const SlotColumn& column : slots) {
    for (int axis = 0; axis < 3; ++axis) {
      row.push_back({std::string(column.name) + "_force_" + "xyz"[axis],
                     shown(contacts[column.slot].force[axis])});
    }
  }
  for (const SlotColumn& column : slots) {
    const ContactReport& contact = contacts[column.slot];
    row.push_back({std::string(column.name) + "_gap", contact.valid ? shown(contact.gap) : ""});
  }
  return row;
}

std::string csvLine(const std::vector<Column>& row, std::string Column::*text) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) line += (i == 0 ? "" : ",") + row[i].*text;
  return line + "\n";
}

// A line on standard error once a second, from the third second on.
class Progress {
 public:
  void show(const Simulation& simulation) {
    const Clock::time_point now = Clock::now();
    if (now - start_ < std::chrono::seconds(2) || now - last_ < std::chrono::seconds(1)) return;
    last_ = now;
    const double duration = simulation.scenario().duration;
    std::cerr << "simulate: " << shown(simulation.time()) << " s of " << shown(duration) << " s, "
              << simulation.counts().steps << " steps, " << simulation.counts().events << " events"
              << std::endl;
  }

 private:
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = start_;
};

void printSummary(Simulation& simulation, const std::string& truth, double wall_time) {
  const RunCounts& counts = simulation.counts();
  std::cout << "status: " << toString(simulation.stopReason()) << "\n"
            << "stopped_at: " << shown(simulation.time()) << "\n"
            << "evaluations: " << counts.evaluations << "\n"
            << "steps: " << counts.steps << "\n"
            << "rejected: " << counts.rejected << "\n"
            << "events: " << counts.events << "\n"
            << "impacts: " << counts.impacts << "\n"
            << "jams: " << counts.painleve_impacts << "\n"
            << "chatters: " << counts.zeno_phases << "\n"
            << "wall_time: " << shown(wall_time) << "\n"
            << (truth == "{}" ? "" : "mismatch: " + truth + "\n") << "final:\n";
  for (const Column& column : rowOf(simulation)) {
    std::string value = column.value.empty() ? "null" : column.value;
    // "---" alone would end the YAML document, and y is a truth value to some readers
    if (column.name == "mode") value = "'" + value + "'";
    const std::string name = column.name == "y" ? "'y'" : column.name;
    std::cout << "  " << name << ": " << value << "\n";
  }
}

Simulation makeSimulation(const Scenario& scenario, const std::string& path) {
  try {
    return Simulation(scenario);
  } catch (const InputError& e) {
    throw InputError(path + ": " + e.what());
  }
}

int run(const std::vector<std::string>& arguments) {
  Options options;
  if (!parseOptions(arguments, options)) return 0;
  Scenario scenario = assembly_cell::loadScenario(options.scenario, options.overrides);
  std::string drawn = "{}";
  if (!options.mismatch.empty()) {
    const assembly_cell::Mismatch mismatch = assembly_cell::loadMismatch(options.mismatch);
    const assembly_cell::Truth truth = drawTruth(mismatch, options.seed);
    scenario = trueScenario(scenario, truth, mismatch.source);
    drawn = truthText(truth);
  }
  const std::vector<double> times = rowTimes(options, scenario.duration);
  Simulation simulation = makeSimulation(scenario, options.scenario);
  std::unique_ptr<assembly_cell::NewFile> csv;
  if (!options.output.empty()) {
    csv = std::make_unique<assembly_cell::NewFile>(
        options.output, "--output: value " + options.output, "give a file that can be written");
  }

  Progress progress;
  double last_row = -1.0;
  const auto writeRow = [&] {
    if (csv) {
      const std::vector<Column> row = rowOf(simulation);
      if (last_row < 0.0) csv->write(csvLine(row, &Column::name));
      csv->write(csvLine(row, &Column::value));
    }
    last_row = simulation.time();
  };
  // wall time is that of the simulation, without the rows
  double wall_time = 0.0;
  const auto advance = [&](double time) {
    StopReason reason = StopReason::kOk;
    do {
      const Clock::time_point start = Clock::now();
      reason = simulation.advance(time, kStepsBetweenLooks);
      wall_time += std::chrono::duration<double>(Clock::now() - start).count();
      progress.show(simulation);
    } while (reason == StopReason::kOk && simulation.time() < time);
    return reason;
  };
  StopReason reason = StopReason::kOk;
  for (const double time : times) {
    reason = advance(time);
    if (reason != StopReason::kOk) break;
    writeRow();
  }
  if (reason == StopReason::kOk) reason = advance(scenario.duration);
  // a run that stops early ends with the row of that time
  if (reason != StopReason::kOk && simulation.time() > last_row) writeRow();

  if (csv) csv->finish();
  printSummary(simulation, drawn, wall_time);
  if (reason != StopReason::kOk) {
    std::cerr << "simulate: stopped at " << shown(simulation.time()) << " s of "
              << shown(scenario.duration) << " s: " << toString(reason) << std::endl;
  }
  return reason == StopReason::kOk ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("simulate", argc, argv, run); }
