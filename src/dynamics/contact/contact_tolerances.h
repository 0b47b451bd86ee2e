// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Thresholds of contact that several files of this folder share.
#pragma once

namespace assembly_cell {

// How each was varied: docs/theory/thesis.md, tuned constants of the dynamics. "Scenes" are 400
// random ones; those with many impacts end elsewhere by any change.

// A contact closes below minus this: far under every tolerance, over the rounding of a gap. Half
// and twice: 65 and 72 scenes end elsewhere, effort the same; Chapter 8 moves by 0.4 nm.
constexpr double kTouch = 1e-14;  // [m]
// Closed at the start up to this gap, what a scenario file's digits leave: 4 and 3 scenes.
constexpr double kInitialReach = 1e-8;  // [m]
// A closed slot leaves reach above this gap, the default tolerance: 35 and 33 scenes, effort −2 %;
// jammed runs take 83 % and 33 % more.
constexpr double kReach = 1e-9;  // [m]
// A contact found deeper is kept there, over the depth that an event leaves: one scene, none.
constexpr double kFound = 1e-11;  // [m]
// Events are located to this, 1e-12 m at 1 m/s: 42 and 51 scenes, effort −1 % and −3 %; Chapter 8
// moves by 0.3 nm.
constexpr double kEventTime = 1e-12;  // [s]
// Relative, makes redundant rows of the complementarity solvable, over rounding: 5 and 3 scenes, by
// up to 2 um.
constexpr double kShift = 1e-11;
// Sliding contacts nearer to a wedge are jammed (docs/theory/thesis.md): jammed runs take 43 % more
// and 7 % less.
constexpr double kWedged = 1e-3;
// As much force between two sticking points, of their load: with less a peg that rests wedged
// begins to slide. 7 scenes each; jammed runs take 43 % and 14 % more.
constexpr double kLoads = 2.0;
// The same where no slip is consistent: what the peg's stiffness allows, a wedge holds.
constexpr double kWedgeLoads = 100.0;
// Approach let be after an impact, over the rounding of impulses: 3 scenes and one, by 3 nm.
constexpr double kSettledSpeed = 1e-9;  // [m/s]
// Of the typical force at a tolerance of 1e-9 m, in proportion to it from 1e-3 to 100: smaller
// changes change no mode; over the rounding of forces, and over what putting contacts right at an
// event changes (else one of twenty events is followed by itself). Half and twice: Chapter 8 moves
// by 2e-13 m, 17 and 22 of 400 random scenes end elsewhere.
constexpr double kHysteresis = 1e-8;
// Least typical acceleration, of a peg without load: no result changes at half or twice.
constexpr double kMinScale = 1e-3;  // [m/s²]

}  // namespace assembly_cell
