// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Thresholds of contact that several files of this folder share.
#pragma once

namespace assembly_cell {

// Effect of half and twice each value, in this order (docs/theory/thesis.md, tuned constants of the
// dynamics): of 400 random scenes so many end elsewhere, where those with many impacts are
// sensitive to any change; "effort" is the number of evaluations.

// Penetration at which a contact closes: far below each tolerance, above the rounding of a gap. 65
// and 72 scenes, effort the same; the run of Chapter 8 moves by 0.4 nm.
constexpr double kTouch = 1e-14;  // [m]
// Gap up to which a contact is closed at the start, from the digits of scenario files: 4 and 3
// scenes.
constexpr double kInitialReach = 1e-8;  // [m]
// Gap above which a closed slot opens, the default tolerance: 35 and 33 scenes, effort −2 %; jammed
// runs take 83 % and 33 % more.
constexpr double kReach = 1e-9;  // [m]
// Depth above which Slot::depth is set, above the depth that an event leaves: one scene, none.
constexpr double kFound = 1e-11;  // [m]
// Resolution of event location, 1e-12 m at 1 m/s: 42 and 51 scenes, effort −1 % and −3 %; Chapter 8
// moves by 0.3 nm.
constexpr double kEventTime = 1e-12;  // [s]
// Relative diagonal shift that regularises redundant rows of the complementarity problem, above
// rounding: 5 and 3 scenes, by up to 2 um.
constexpr double kShift = 1e-11;
// wedgeMargin() below which slipping contacts undergo a Painlevé impact (docs/theory/thesis.md):
// jammed runs take 43 % more and 7 % less.
constexpr double kWedged = 1e-3;
// Limit of the internal force of two sticking points over their load; with a lower one a peg that
// rests wedged begins to slide. 7 scenes each; jammed runs take 43 % and 14 % more.
constexpr double kLoads = 2.0;
// The factor where no slip is consistent.
constexpr double kWedgeLoads = 100.0;
// Approach speed tolerated after an impact, above the rounding of impulses: 3 scenes and one, by 3
// nm.
constexpr double kSettledSpeed = 1e-9;  // [m/s]
// Hysteresis of forces over the typical force, at a tolerance of 1e-9 m; scaled by
// System::coarseness. Above the rounding of forces and above the change by project() at an event
// (with less, one of twenty events repeats itself). 17 and 22 scenes; Chapter 8 moves by 2e-13 m.
constexpr double kHysteresis = 1e-8;
// Lower bound of the typical acceleration, for a peg without load: no result changes.
constexpr double kMinScale = 1e-3;  // [m/s²]

}  // namespace assembly_cell
