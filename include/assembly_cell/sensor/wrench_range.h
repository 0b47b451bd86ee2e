// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Largest loads of the largest six-axis sensors on the market: a value beyond is a code for a
/// fault or an end of the number range.
constexpr double kLargestForce = 9e4;   ///< [N]
constexpr double kLargestTorque = 9e3;  ///< [N·m]

/// Each component limited to the range of messages (guard/message_check.h): nodes refuse a block
/// that exceeds it, so it would be missing. [N], [N·m] and [m], [rad].
Vector6 cutWrench(const Vector6& w);
Vector6 cutDisplacement(const Vector6& d);

}  // namespace assembly_cell
