// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>

namespace assembly_cell {

/// Of phasors of the simulation and the model: 1 % and 1°, of small ones 1 % of `whole`.
inline void expectClose(std::complex<double> simulated, std::complex<double> model, double whole,
                        const std::string& what) {
  if (std::abs(model) < 0.01 * whole) {
    EXPECT_LT(std::abs(simulated - model), 0.01 * whole) << what;
    return;
  }
  EXPECT_NEAR(std::abs(simulated) / std::abs(model), 1, 0.01) << what;
  EXPECT_NEAR(std::arg(simulated / model) * 180 / M_PI, 0, 1) << what;
}

}  // namespace assembly_cell
