// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/CalibrationResult.h>
#include <assembly_cell/CalibrationTest.h>
#include <assembly_cell/DisplacementResult.h>
#include <assembly_cell/LoadStep.h>
#include <assembly_cell/SensorCalibration.h>
#include <assembly_cell/StrainSamples.h>

#include <string>

#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/session.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell::ros_bridge {

SensorCalibration toMessage(const Calibration& calibration);

/// Throws InputError beginning with `source` for arrays of a wrong size.
Calibration fromMessage(const SensorCalibration& message, const std::string& source);

/// The load of an observation, without measurements and stamp.
CalibrationTest toMessage(const Observation& observation);

/// Throws InputError beginning with `source`: unknown kind or sensor, an invalid pose, arrays of a
/// wrong size. checkObservation() checks the rest.
Observation fromMessage(const CalibrationTest& test, const std::string& source);

LoadStep toMessage(const LoadRequest& request);
LoadRequest fromMessage(const LoadStep& step, const std::string& source);

CalibrationResult toMessage(const ForceSolution& solution, const ObservationSet& set);
DisplacementResult toMessage(const DisplacementSolution& solution);
CalibrationResult toMessage(const CalibrationSolution& solution);

/// Six numbers in a printf pattern each, "fx fy fz N, tx ty tz N m".
std::string wrenchText(const Vector6& w, const char* pattern);

}  // namespace assembly_cell::ros_bridge
