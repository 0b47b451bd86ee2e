// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/range.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {

/// A key of a mismatch file besides `scale` and `add`: what may be drawn, how, and where it goes.
struct DrawKey {
  enum class Shape {
    kNumber,
    kAxes,       ///< three numbers, each drawn
    kDirection,  ///< a vector of the drawn size in a random direction
    kTilt,       ///< the same in the plane
    kMatrix      ///< 6×6, each entry drawn
  };
  std::string path;  ///< "sensor_a.drift.force"
  Shape shape;
  double* values;
  Range range;        ///< of the drawn number; kLargestDraw: unbounded
  double mean = 0.0;  ///< mean of a normal draw
  // a random angle that is drawn after the number, and its name in a run's report; null: none
  const char* angle_name = nullptr;
  double* angle = nullptr;
  bool required = false;  ///< if its section is there
};

constexpr double kLargestDraw = 1e9;

/// All of them in the order of the file; `values` are in `truth`.
std::vector<DrawKey> drawKeys(Truth& truth);

}  // namespace assembly_cell
