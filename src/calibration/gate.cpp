// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/gate.h"

#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace assembly_cell {

void addGate(std::vector<Gate>& gates, bool bad, Gate gate) {
  if (!bad) gate.verdict = Verdict::kPass;
  if (!bad) gate.text.clear();
  gates.push_back(gate);
}

double chi2Tail(double chi2, int dof) {
  if (dof <= 0 || chi2 <= 0.0) return 1.0;
  if (!std::isfinite(chi2)) return 0.0;
  return boost::math::gamma_q(0.5 * dof, 0.5 * chi2);
}

double chi2Limit(double p, int dof) {
  return dof <= 0 ? 0.0 : 2.0 * boost::math::gamma_q_inv(0.5 * dof, p);
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
