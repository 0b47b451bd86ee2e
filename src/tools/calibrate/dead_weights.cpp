// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/dead_weights/dead_weights.h"

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "commands.h"
#include "print.h"

namespace assembly_cell {

namespace {

constexpr const char* kHelp =
    R"(Usage: calibrate deadweights FILE.csv

Map of a six-axis sensor's readings to wrenches from known dead weights. FILE.csv: columns fx fy fz tx ty tz as read and
known_fx ... known_tz [N, N m] as hung (mx for tx too) by a header, or these twelve without one; empty known cells: a
reading without label. A block begins where the reading falls to that of no load, and has its own zero.
Names labels that cannot be right (rows swapped, another arm or sign), which the map then doesn't rest on, and loads that
are missing. Errors: of the fit, each row left out, each block left out.

  --help                print this

Exit code: 0 ok, 1 a label is wrong, the loads don't have full rank, or readings, units or loads are not what they should
be (findings), 2 bad input.

Example: calibrate deadweights readings.csv
)";

void print(const DeadWeightSolution& s, const std::vector<DeadWeight>& rows) {
  line("rows", std::to_string(rows.size()));
  line("blocks", std::to_string(s.blocks));
  std::cout << "wrong_labels:" << (s.wrong.empty() ? " []" : "") << "\n";
  for (const WrongLabel& w : s.wrong) {
    std::cout << "  - {line: " << rows[w.row].line << ", row: " << w.row
              << ", force_error: " << yamlNumber(w.force_error)
              << ", moment_error: " << yamlNumber(w.moment_error) << ", read: " << list(w.expected)
              << ", text: " << yamlQuoted(w.text) << "}\n";
  }
  line("rank", std::to_string(s.rank));
  std::cout << "missing:" << (s.missing.empty() ? " []" : "") << "\n";
  for (const std::string& text : s.missing) std::cout << "  - " << yamlQuoted(text) << "\n";
  std::cout << "findings:" << (s.findings.empty() ? " []" : "") << "\n";
  for (const std::string& text : s.findings) std::cout << "  - " << yamlQuoted(text) << "\n";
  std::string one_sign;
  for (const std::string& axis : s.one_sign) one_sign += (one_sign.empty() ? "" : ", ") + axis;
  line("loaded_one_way", "[" + one_sign + "]");
  line("residual_rms", list(s.residual_rms));
  line("left_out_rms", list(s.left_out_rms));
  line("left_out_block_rms", list(s.left_out_block_rms));
  line("left_out_block_rank", s.block_possible ? "full" : "a load is in one block only");
  std::cout << "unlabelled:" << (s.unlabelled.empty() ? " []" : "") << "\n";
  for (std::size_t k = 0; k < s.unlabelled.size(); ++k) {
    std::cout << "  - {line: " << rows[s.unlabelled[k]].line
              << ", load: " << list(s.unlabelled_load[k]) << ", sd: " << list(s.unlabelled_sd[k])
              << "}\n";
  }
  std::cout << "zeros:\n";
  for (const Vector6& zero : s.zero) std::cout << "  - " << list(zero) << "\n";
  printMatrix("matrix", s.map);
  printMatrix("sd", s.covariance.diagonal().cwiseSqrt().reshaped(6, 6).transpose());
}

}  // namespace

int deadWeights(const std::vector<std::string>& arguments) {
  std::string path;
  OptionParser parser(kHelp);
  parser.file("file of loads and readings", path);
  if (!parser.parse(arguments)) return 0;
  const std::vector<DeadWeight> rows = readDeadWeights(path);
  DeadWeightSolution solution;
  try {
    solution = solveDeadWeights(rows);
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
  print(solution, rows);
  if (!solution.findings.empty()) {
    std::cerr << "calibrate: " << solution.findings.front() << "\n";
    return 1;
  }
  return solution.wrong.empty() && solution.rank == 6 ? 0 : 1;
}

}  // namespace assembly_cell
