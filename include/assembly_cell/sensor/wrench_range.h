// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// Beyond the largest six-axis sensors that are sold: a sensor's code for a fault, or an end of its
/// numbers. No load.
constexpr double kLargestForce = 9e4;   ///< [N]
constexpr double kLargestTorque = 9e3;  ///< [N·m]

}  // namespace assembly_cell
