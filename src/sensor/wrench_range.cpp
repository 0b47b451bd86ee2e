// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/wrench_range.h"

#include <algorithm>

#include "assembly_cell/guard/message_check.h"

namespace assembly_cell {

namespace {

Vector6 cut(const Vector6& value, const Range& linear, const Range& angular) {
  Vector6 within = value;
  for (int i = 0; i < 6; ++i) {
    const Range& range = i < 3 ? linear : angular;
    within[i] = std::min(std::max(range.low, value[i]), range.high);
  }
  return within;
}

}  // namespace

Vector6 cutWrench(const Vector6& w) { return cut(w, kForceField, kTorqueField); }

Vector6 cutDisplacement(const Vector6& d) { return cut(d, kDisplacementField, kRotationField); }

}  // namespace assembly_cell
