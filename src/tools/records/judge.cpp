// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <iostream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/verdict.h"
#include "commands.h"
#include "run_source.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp =
    R"(Usage: records judge --rules PATH [options]
       records judge --rules PATH --program P --curves PATH... [options]

What boxes and bands state of runs, a line a verdict: run, serial, rule, passed, margin (1 in the middle, 0 at the limit,
below 0 outside; null: not evaluated), where that is [m], over time [s], and in words. The store isn't changed.

  --rules PATH           a file of rules, or a folder of *.yaml; several times
  --outside              only the verdicts that aren't passed
)";
constexpr const char* kHelpEnd = R"(  --limit N              the latest N of them (0: all)
  --help                 print this

Exit code: 0 all passed, 1 one didn't, 2 bad input, among it runs that no rule is for.

Example: records judge --rules plate.yaml --program plate --outside
)";

}  // namespace

int evaluateRuns(const std::vector<std::string>& arguments) {
  std::vector<std::string> paths;
  bool only_outside = false;
  OptionParser parser(std::string(kHelp) + kSourceHelp + kFilterHelp + kHelpEnd);
  RunSource source(parser, 0);
  parser.texts("--rules", paths);
  parser.flag("--outside", only_outside);
  if (!parser.parse(arguments)) return 0;
  if (paths.empty()) throw InputError("--rules: missing: give a file of rules");
  const RunRules rules(paths);
  std::size_t failed = 0, without = 0;
  std::string program;
  const std::size_t count = source.each([&](Run& run) {
    const std::vector<RunVerdict> verdicts = rules.evaluate(run);
    if (verdicts.empty()) {
      ++without;
      program = run.program;
    }
    bool passed = true;
    for (const RunVerdict& v : verdicts) {
      passed = passed && v.passed;
      if (v.passed && only_outside) continue;
      std::cout << "- "
                << YamlMapping()
                       .integer("run", static_cast<long>(run.id))
                       .quoted("serial", run.serial)
                       .quoted("rule", v.rule)
                       .add("passed", v.passed ? "true" : "false")
                       .number("margin", v.margin)
                       .number("at", v.depth)
                       .quoted("text", v.text)
                       .text()
                << "\n";
    }
    failed += passed ? 0 : 1;
  });
  if (without == count) {
    throw InputError("--rules: none is for program " + yamlQuoted(program) + " of the runs");
  }
  std::cout << "# " << count << " runs, " << failed << " out of their rules";
  if (without > 0) std::cout << ", " << without << " of programs without a rule";
  std::cout << "\n";
  return failed > 0 ? 1 : 0;
}

}  // namespace assembly_cell
