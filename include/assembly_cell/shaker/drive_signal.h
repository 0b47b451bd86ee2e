// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {

/// The exciter's rotating force over time, without steps. A command fades in over `ramp`; the one
/// before fades out within that and within one period of its own. Phases are exact: a force is
/// amplitude · (cos, sin) of direction · (frequency · (t − reference) + phase), peg axes x and y,
/// as in Exciter.msg, times its fade.
struct DriveSignal {
  struct Voice {
    ExciterCommand drive;
    double reference = 0.0;         ///< [s]
    double begin = 0.0, end = 0.0;  ///< of its fades in and out [s]; end: infinity while on
    double rise = 0.0, fall = 0.0;  ///< how long they take [s]
  };
  double ramp = 0.05;  ///< [s]
  /// Those that are on or fade, oldest first. With a fourth change within a fade the oldest is cut.
  std::array<Voice, 4> voices;
  std::size_t count = 0;
};

/// From `time` on, by the exciter's clock [s]; amplitude 0: off.
void drive(DriveSignal& signal, const ExciterCommand& command, double reference, double time);

/// Forgets what has faded out before `time`.
void forget(DriveSignal& signal, double time);

/// Along the peg's x and y [N].
Eigen::Vector2d forceAt(const DriveSignal& signal, double time);

}  // namespace assembly_cell
