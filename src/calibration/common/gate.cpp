// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/common/gate.h"

namespace assembly_cell {

void addGate(std::vector<Gate>& gates, bool bad, Gate gate) {
  if (!bad) gate.verdict = Verdict::kPass;
  if (!bad) gate.text.clear();
  gates.push_back(gate);
}

std::string gateTexts(const std::vector<Gate>& gates, Verdict verdict) {
  std::string out;
  for (const Gate& gate : gates) {
    if (gate.verdict != verdict) continue;
    if (!out.empty()) out += "; ";
    out += gate.text;
  }
  return out;
}

}  // namespace assembly_cell
