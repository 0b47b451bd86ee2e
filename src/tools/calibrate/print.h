// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the commands of calibrate print alike, as YAML.
#pragma once

#include <Eigen/Core>
#include <iostream>
#include <string>
#include <vector>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/calibration/common/gate.h"

namespace assembly_cell {

template <typename Values>
std::string list(const Values& values) {
  std::string text;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    text += (i == 0 ? "" : ", ") + yamlNumber(values[i]);
  }
  return "[" + text + "]";
}

inline void line(const std::string& key, const std::string& value) {
  std::cout << key << ": " << value << "\n";
}

inline void printMatrix(const std::string& key, const Eigen::MatrixXd& m) {
  if (m.size() == 0) return line(key, "null");
  std::cout << key << ":\n  rows: " << m.rows() << "\n  cols: " << m.cols() << "\n  data: [";
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      std::cout << (i + j > 0 ? ", " : "") << yamlNumber(m(i, j));
    }
  }
  std::cout << "]\n";
}

inline void printGates(const std::vector<Gate>& gates, const std::string& indent = "") {
  std::cout << indent << "gates:\n";
  for (const Gate& gate : gates) {
    std::cout << indent << "  - {name: " << gate.name << ", verdict: "
              << (gate.verdict == Verdict::kPass   ? "pass"
                  : gate.verdict == Verdict::kWarn ? "warn"
                                                   : "refuse")
              << ", value: " << yamlNumber(gate.value) << ", limit: " << yamlNumber(gate.limit);
    if (!gate.text.empty()) std::cout << ", text: " << yamlQuoted(gate.text);
    std::cout << "}\n";
  }
}

}  // namespace assembly_cell
