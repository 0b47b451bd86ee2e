// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

/// Why a reading, a test, a request or a recording is refused.
enum class CalibrationFailure {
  kNone,
  // a reading
  kSaturated,
  kUnsettled,
  // a test of a set
  kNoZero,          ///< no unloaded reading before it
  kZeroDrifted,     ///< the unloaded readings around it differ
  kNoDisplacement,  ///< its point is that at rest, and there is no displacement map
  kOutlier,
  // a window of samples
  kSilent,     ///< no samples
  kTooSlow,    ///< too few samples
  kRestarted,  ///< the source restarted meanwhile
  kApart,      ///< the sensors' samples are not of the same time
  kCancelled,
  // a session
  kNothingToSolve,
  kNotSolved,
  kNotAccepted,
  kNoWrench,  ///< a displacement alone makes no calibration
  kIdTaken,
  kUnknownId,
  kForeign,  ///< of another sensor
  kRenamed,  ///< its id isn't the file's name
  // rig and drivers
  kRigRefused,
  kDriverRefused,
  // static poses
  kTooFewPoses,
  kOneAxis,        ///< the orientations do not separate weight from bias
  kAxesUndecided,  ///< base and sensor axes fit alike
  kNoWeight,       ///< the readings don't follow the orientations
};

/// A failure and one line of explanation; true when there is a failure.
struct CalibrationRefusal {
  CalibrationFailure code = CalibrationFailure::kNone;
  std::string text;

  explicit operator bool() const { return code != CalibrationFailure::kNone; }
};

/// A refused request of a session.
struct CalibrationError : InputError {
  CalibrationError(CalibrationFailure failure, const std::string& text)
      : InputError(text), code(failure) {}
  CalibrationFailure code;
};

}  // namespace assembly_cell
