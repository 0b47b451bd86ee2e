// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"

namespace assembly_cell {

/// A recorded motion of the peg under the exciter.
struct RecordedMotion {
  enum class Kind {
    kPlane,         ///< x, y of a point of the peg [m]
    kAcceleration,  ///< ax, ay of it [m/s²], as x and y
    kDisplacement   ///< the coupling's six displacements [m], [rad]
  };
  Kind kind = Kind::kPlane;
  std::string time_unit;        ///< of the file, and why
  std::vector<double> t;        ///< [s], rising; the exciter's phase is zero at t = 0
  std::vector<double> signals;  ///< 6 × n; unused ones are zero
  std::vector<double> sd;       ///< of each sample; empty: not given
  /// The exciter's settings, where the recording has them: [rad/s], [N], ±1.
  std::optional<double> frequency, amplitude;
  std::optional<int> direction;
};

/// A CSV file with a header row: columns by name t and x, y, or ax, ay, or x, y, z, rx, ry, rz;
/// uncertainty (one sd for both axes) if there; others are ignored. Or a bag of
/// displacement_samples or accelerometers (scripts/from_bag.py). topic: of a bag with several.
/// Times in s, or in the unit that is given or in the header. Throws InputError naming file, line
/// and column.
RecordedMotion readMotion(const std::string& path, const std::string& topic = {},
                          TimeUnit unit = TimeUnit::kFound);

}  // namespace assembly_cell
