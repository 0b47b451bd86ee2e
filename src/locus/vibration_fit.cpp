// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/vibration_fit.h"

#include <cmath>

namespace assembly_cell {

HarmonicFit fitVibration(const std::vector<double>& angle, const std::vector<double>& wrenches) {
  HarmonicFit fit = fitHarmonic(angle, wrenches);
  Vector6 before = Vector6::Zero();
  Matrix6 sum = Matrix6::Zero();
  for (std::size_t k = 0; k < angle.size(); ++k) {
    const Vector6 wave =
        fit.phasor.real() * std::cos(angle[k]) - fit.phasor.imag() * std::sin(angle[k]);
    const Vector6 rest = Vector6::Map(wrenches.data() + 6 * k) - wave;
    if (k > 0) sum.noalias() += (rest - before) * (rest - before).transpose();
    before = rest;
  }
  fit.noise = sum / (2.0 * static_cast<double>(angle.size() - 1));
  return fit;
}

}  // namespace assembly_cell
