// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>

#include "assembly_cell/base/yaml_text.h"
#include "commands.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp = R"(Usage: records show N [options]

One run as YAML; of its curve the number of samples, the largest axial force and the depth at the end. All of the
curve: records export N.

  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records show 17
)";

void printTexts(const char* key, const std::map<std::string, std::string>& texts) {
  YamlMapping mapping;
  for (const auto& [name, value] : texts) mapping.quoted(yamlQuoted(name), value);
  std::cout << key << ": " << mapping.text() << "\n";
}

template <class Rows, class Print>
void printRows(const char* key, const Rows& rows, const Print& print) {
  std::cout << key << (rows.empty() ? ": []\n" : ":\n");
  for (const auto& row : rows) {
    YamlMapping mapping;
    print(mapping, row);
    std::cout << "  - " << mapping.text() << "\n";
  }
}

void printCurve(const Curve& curve) {
  YamlMapping mapping;
  mapping.integer("samples", static_cast<long>(curve.size()));
  if (curve.size() > 0) {
    mapping.number("peak_force", *std::max_element(curve.axial.begin(), curve.axial.end()))
        .number("seating_depth", curve.depth.back());
  }
  std::cout << "curve: " << mapping.text() << "\n";
}

void printRun(const Run& run) {
  const auto text = [](const char* key, const std::string& value) {
    std::cout << key << ": " << yamlQuoted(value) << "\n";
  };
  std::cout << "run: " << run.id << "\n";
  text("serial", run.serial);
  text("program", run.program);
  text("program_hash", run.program_hash);
  text("station", run.station);
  std::cout << "start: " << timeText(run.start) << "\nduration: " << yamlNumber(run.duration)
            << "\n";
  text("strategy", run.strategy);
  text("result", run.result);
  text("failure", run.failure);
  text("text", run.text);
  printTexts("versions", run.versions);
  printTexts("calibrations", run.calibrations);
  printTexts("settings", run.settings);
  printTexts("simulation", run.simulation);
  printCurve(run.curve);
  printRows("estimates", run.estimates, [](YamlMapping& m, const RunEstimate& e) {
    m.quoted("name", e.name).number("value", e.value).number("sd", e.sd);
  });
  printRows("verdicts", run.verdicts, [](YamlMapping& m, const RunVerdict& v) {
    m.quoted("rule", v.rule).quoted("kind", v.kind).add("passed", v.passed ? "true" : "false");
    m.number("margin", v.margin).number("depth", v.depth).quoted("quantity", v.quantity);
    m.quoted("text", v.text);
  });
  printRows("events", run.events, [](YamlMapping& m, const RunEvent& e) {
    m.number("time", e.time).quoted("kind", e.kind).quoted("text", e.text);
  });
}

}  // namespace

int showRun(const std::vector<std::string>& arguments) {
  std::string number;
  OptionParser parser(kHelp);
  parser.file("number of a run", number);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  printRun(store.open().read(runNumber(number)));
  return 0;
}

}  // namespace assembly_cell
