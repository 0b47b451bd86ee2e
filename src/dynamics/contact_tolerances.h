// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Thresholds of contact that several files of this folder share.
#pragma once

namespace assembly_cell {

// a contact closes below minus this: far under every tolerance, over the rounding of a gap [m]
constexpr double kTouch = 1e-14;
constexpr double kInitialReach = 1e-8;  // closed at the start up to this gap [m]
constexpr double kReach = 1e-9;         // a closed slot leaves reach above this gap [m]
constexpr double kFound = 1e-11;        // a contact found deeper is kept there [m]
constexpr double kEventTime = 1e-12;    // events are located to this [s]
constexpr double kShift = 1e-11;        // relative, makes redundant rows of law B solvable
constexpr double kWedged = 1e-3;        // slipping points nearer to a wedge are jammed
constexpr double kLoads = 2.0;          // as much force between two resting points, of their load
constexpr double kSettledSpeed = 1e-9;  // approach let be after an impact [m/s]

}  // namespace assembly_cell
