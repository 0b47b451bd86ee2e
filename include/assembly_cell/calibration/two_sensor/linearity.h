// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/calibration/common/gate.h"
#include "assembly_cell/calibration/observations/observation.h"

namespace assembly_cell {

/// One step of the test: set load and reading of the channel.
struct LinearityStep {
  double load = 0.0;
  double reading = 0.0;
};

/// Thesis Appendix 2 completed: a channel against load, up and down, at least two cycles.
struct LinearityResult {
  double slope = 0.0, intercept = 0.0;  ///< straight line, least squares
  double span = 0.0;                    ///< |slope| × range of loads
  double nonlinearity = 0.0;            ///< max |mean residual at a load| / span
  double hysteresis = 0.0;              ///< max |mean up − mean down| / span
  double quadratic = 0.0;      ///< of ((load − middle)/half range)², in parts of the span
  double quadratic_t = 0.0;    ///< its t
  double lack_of_fit_f = 0.0;  ///< against the pure error of repeats in the same direction
  int lack_of_fit_dof = 0, pure_error_dof = 0;
  double lack_of_fit_p = 1.0;
  bool linear_model_allowed = false;  ///< no gate refuses
  std::vector<Gate> gates;            ///< nonlinearity 0.2 % warns, 0.5 % refuses; hysteresis 0.1 %
};

/// Steps in the order of time; up or down follows from the previous step. Throws InputError: fewer
/// than three loads, no repeats, not finite.
LinearityResult testLinearity(const std::vector<LinearityStep>& steps);

/// The linearity observations of one side and channel.
std::vector<LinearityStep> linearitySteps(const ObservationSet& set, Side side, int channel);

}  // namespace assembly_cell
