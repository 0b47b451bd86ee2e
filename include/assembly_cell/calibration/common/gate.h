// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell {

/// What a check found: nothing, a warning, or a reason to refuse.
enum class Verdict { kPass, kWarn, kRefuse };

/// One check (docs/how_to/calibration.md, "What is refused") with its numbers. `text` is one line
/// that names what is wrong and what to add; empty when passed.
struct Gate {
  std::string name;  ///< rank, condition, predicted_sd, dof, chi2, low_chi2, geometry, …
  Verdict verdict = Verdict::kPass;
  double value = 0.0;
  double limit = 0.0;
  std::string text;
};

/// Adds a check; one that isn't `bad` passes, its verdict and text don't count.
void addGate(std::vector<Gate>& gates, bool bad, Gate gate);

inline bool refused(const std::vector<Gate>& gates) {
  for (const Gate& gate : gates) {
    if (gate.verdict == Verdict::kRefuse) return true;
  }
  return false;
}

/// The texts of all gates with this verdict, joined by "; ".
std::string gateTexts(const std::vector<Gate>& gates, Verdict verdict);

}  // namespace assembly_cell
