// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {

/// Rotating force of the exciter over time, without steps. A command fades in over `ramp`; the
/// previous one fades out within that and within one period of its own. The force is amplitude ·
/// (cos, sin) of direction · (frequency · (t − reference) + phase) along peg axes x and y, as in
/// Exciter.msg, times its fade.
struct DriveSignal {
  struct Voice {
    ExciterCommand drive;
    double reference = 0.0;         ///< [s]
    double begin = 0.0, end = 0.0;  ///< start of fading in and out [s]; end: infinity while on
    double rise = 0.0, fall = 0.0;  ///< durations of the fades [s]
  };
  double ramp = 0.05;  ///< [s]
  /// Commands that are on or fading, oldest first. A fourth change within a fade drops the oldest.
  std::array<Voice, 4> voices;
  std::size_t count = 0;
};

/// Applies a command from `time` on, clock of the exciter [s]; amplitude 0: off.
void drive(DriveSignal& signal, const ExciterCommand& command, double reference, double time);

/// Removes commands that have faded out before `time`.
void removeFaded(DriveSignal& signal, double time);

/// Force along the peg's x and y [N].
Eigen::Vector2d forceAt(const DriveSignal& signal, double time);

}  // namespace assembly_cell
