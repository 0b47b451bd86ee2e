// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <array>
#include <iostream>
#include <utility>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/band.h"
#include "commands.h"
#include "run_source.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp =
    R"(Usage: records learn --program P --output BAND.yaml [options]
       records learn --program P --output BAND.yaml --curves PATH... [options]

A band that curves of good runs stay in, by split conformal prediction: of exchangeable good runs at most the fraction
alpha leaves it. Every second run sets mean and standard deviation, the others the limit. docs/theory/records.md

  --output FILE          the band as a file of rules
  --alpha A              rate of false alarms (0.01); n runs to calibrate support at least 1/(n + 1)
  --quantity Q           axial, lateral, moment or tilt; several times (axial)
  --over-time            over time instead of depth
  --cell LENGTH          of a cell [m], over time [s] (0.0005, 0.1)
  --path LOW,HIGH        part that is evaluated [m] or [s] (what all runs of the learning half cover)
  --name NAME            of the band (band)
  --all                  learns from runs of any result; otherwise from seated ones
)";
constexpr const char* kHelpEnd = R"(  --limit N              the latest N of them (0: all)
  --help                 print this

Exit code: 0 ok, 2 bad input.

Example: records learn --program plate --result seated --alpha 0.05 --output plate.yaml
)";

}  // namespace

int learnRules(const std::vector<std::string>& arguments) {
  BandSettings settings;
  settings.quantities.clear();
  std::string output;
  std::array<double, 2> path = {settings.from, settings.to};
  bool all = false;
  OptionParser parser(std::string(kHelp) + kSourceHelp + kFilterHelp + kHelpEnd);
  RunSource source(parser, 0);
  parser.text("--output", output);
  parser.text("--name", settings.name);
  parser.number("--alpha", settings.alpha, 1e-9, 1.0);
  parser.texts("--quantity", settings.quantities);
  parser.flag("--over-time", settings.over_time);
  parser.number("--cell", settings.step, 1e-9, 1e6);
  parser.numbers("--path", path.data(), path.size());
  parser.flag("--all", all);
  if (!parser.parse(arguments)) return 0;
  if (output.empty()) throw InputError("--output: missing: give the file of the band");
  if (settings.name.empty()) throw InputError("--name: empty: give the name of the band");
  settings.from = path[0];
  settings.to = path[1];
  if (settings.quantities.empty()) settings.quantities = {"axial"};
  settings.program = source.program();
  parser.notWith("--all", {"--result"});
  parser.notWith("--curves", {"--all"});
  const bool seated = !all && !parser.given("--result") && !parser.given("--curves");
  std::vector<Curve> good;
  source.each([&](Run& run) {
    if (seated && run.result != "seated") return;
    good.push_back(std::move(run.curve));
  });
  if (good.empty())
    throw InputError("--result: none of the runs is seated: give --result, or --all");
  const Band band = learnBand(good, settings);
  writeFileAtomically(output, rulesText(band), output);
  std::cout << "band: " << yamlQuoted(output) << "\nlearnt: " << band.learnt
            << "\ncalibrated: " << band.calibrated << "\nalpha: " << yamlNumber(band.alpha)
            << "\nlimit: " << yamlNumber(band.limit) << "  # standard deviations\npath: ["
            << yamlNumber(band.from) << ", " << yamlNumber(band.to()) << "]  # "
            << (band.over_time ? "s" : "m") << "\ncells: " << band.cells() << "\n";
  return 0;
}

}  // namespace assembly_cell
