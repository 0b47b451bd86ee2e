// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// Rig of chapter 5. M_over_L is the moment scaled as a length; K a number, so K g an acceleration.
struct RigCase {
  double x0 = 0.0;  ///< misalignment
  double M_over_L = 0.0, f_hz = 0.0, K = 0.0, g = 0.0;
};

/// One slide from rest.
struct RigSlide {
  double time = 0.0;  ///< sliding time
  double x = 0.0;     ///< misalignment after it, 0 when assembled
};

struct RigResult {
  bool never = false;  ///< x0 >= 2 M_over_L (1 − 1e-12): never tips; time and cycles are undefined
  double time = 0.0;   ///< from the first tip to assembly
  int cycles = 0;      ///< slides
};

/// 5.2–5.5: the first sliding time after the trivial root 0 at which 5.6 (corrected: it is Δt² on
/// the left) holds, or the time to assembly if that comes first. From misalignment x in (0, 1) with
/// acceleration a > 0; lengths in 2 M_over_L, times in 1/w: a = K g/(2 M_over_L w²).
RigSlide rigSlide(double x, double a);

/// Slides repeated once a revolution of the moment until the misalignment is zero. Throws
/// InputError beyond a million revolutions.
RigResult rigAssembly(const RigCase& c);

}  // namespace assembly_cell
