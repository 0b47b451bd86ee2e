// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Aligns the peg of a scenario in simulation, by the core library alone, and prints the errors.
// usage: align_once [SCENARIO.yaml [STRATEGY]]    none: the default cell, by its contacts' places
#include <assembly_cell/base/input_error.h>
#include <assembly_cell/cell/align_trial.h>

#include <cstdio>
#include <string>

int main(int argc, char** argv) {
  const std::string path = argc > 1 ? argv[1] : SHARE_DIR "/config/scenarios/cell.yaml";
  assembly_cell::AlignParameters parameters;
  parameters.strategy = argc > 2 ? argv[2] : "touch";
  try {
    // the ground truth is the scenario; the strategy has the parts as they are drawn
    const assembly_cell::Scenario scenario = assembly_cell::loadScenario(path);
    const assembly_cell::AlignTrial trial = assembly_cell::tryAlignment(
        scenario, scenario.mechanism, assembly_cell::CellParameters(), parameters);
    std::printf("%s\n", trial.result.reason.c_str());
    if (!trial.success) return 1;
    std::printf("%d contacts, offset wrong by %.4f mm\n", static_cast<int>(trial.result.contacts),
                1e3 * (trial.result.offset - trial.true_offset).norm());
  } catch (const assembly_cell::InputError& error) {
    std::fprintf(stderr, "align_once: %s\n", error.what());
    return 2;
  }
  return 0;
}
