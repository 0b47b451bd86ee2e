// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Recordings of static poses: CSV with optional header (docs/payload.md).
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/calibration/payload.h"

namespace assembly_cell {

struct Poses {
  std::vector<StaticPose> values;
  bool ordered = false;
};

struct Wrenches {
  std::vector<Vector6> values;
  std::vector<double> temperature;
  bool header = false;
};

/// Throw InputError naming file, line and column.
Poses readPoses(const std::string& path);
Wrenches readWrenches(const std::string& path);

}  // namespace assembly_cell
