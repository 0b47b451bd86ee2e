// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {

/// Forecast of a measurement of the contact's direction; each value for the worst direction.
struct DirectionForecast {
  double frequency = 0.0;       ///< of the exciter [rad/s]
  double direction_sd = 0.0;    ///< by noise, Cramér–Rao [rad]; π: unobservable
  double direction_bias = 0.0;  ///< if the resonances are 1 % off the model's [rad]
  double axes_ratio =
      0.0;  ///< smallest |semi-minor| over semi-major: 0 looks like a double contact
  double friction_demand = 0.0;  ///< largest tangential over normal contact force in a turn
};

/// noise: covariance of one sample of the coupling's six displacements; samples: of the window.
/// Throws InputError as contactResponse.
DirectionForecast forecastDirection(const Mechanism& mechanism, const OperatingPoint& point,
                                    const Matrix6& noise, double samples);

/// Acceptance limits of a forecast.
struct ForecastLimits {
  double direction_sd = 0.1;  ///< [rad]
  double axes_ratio = 0.1;
  double friction_demand = 0.2;  ///< coefficient of static friction
};

/// Empty, or why a measurement at this point is refused: `too_uncertain`, `would_slip` or
/// `looks_double`, with its number and what to do.
std::string refusalOf(const DirectionForecast& forecast, const ForecastLimits& limits);

/// The frequency within an octave of operatingFrequency() where the forecast sd is
/// smallest, among those that no limit refuses; where all are refused, the smallest of all. point:
/// all but its frequency. rate: of the samples [Hz], at least three a turn; duration: of the window
/// [s]. Throws InputError as operatingFrequency, and where the rate is too low for the whole
/// octave.
DirectionForecast chooseFrequency(const Mechanism& mechanism, OperatingPoint point,
                                  const Matrix6& noise, double rate, double duration,
                                  const ForecastLimits& limits = {});

}  // namespace assembly_cell
