// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/align/search/guarded_carrier.h"

namespace assembly_cell {

// Motions that get a peg free, and the proof that it is.

/// A carrier at rest reports its height to within this [m]
inline constexpr double kHeightNoise = 2e-4;

/// The first tare, with contact excluded: the force is the weight of this peg or doesn't change
/// over a millimetre of travel up and 0.3 mm to two sides. A peg in contact is lifted until then,
/// exciter off. Throws AlignError `in_contact` when it isn't free within 25 mm or holds twice the
/// force limit, `not_still` where noise hides a contact.
void tareFreePeg(GuardedCarrier& carrier, const Mechanism& mechanism);

/// After a failed goal: exciter off, a millimetre up with any force, then tareFreePeg(). hung:
/// where the peg is known to have hung free. A peg at that height or above isn't lifted, and it
/// returns there if it is still there but for the steps of tareFreePeg(): repeated failures don't
/// raise it.
void releasePeg(GuardedCarrier& carrier, const Mechanism& mechanism,
                const std::optional<RestPose>& hung = std::nullopt);

/// Up from `from` in small steps, over `min_travel` [m] and on until the peg is free or the travel
/// is `max_travel` [m]; a wedged peg is turned about its axis. Returns where that ended; throws
/// AlignError `stuck`.
RestPose pullUp(GuardedCarrier& carrier, const RestPose& from, double min_travel,
                double max_travel);

/// Exciter off, over `relaxed` (where the coupling isn't strained), from there to `turned` as far
/// as half the force limit moves it, and up by `travel` [m]; waits until the peg hangs still.
/// Throws AlignError `stuck` when it doesn't come free, `zero_shifted` when the free peg weighs
/// something else than at the first tare.
void retreatUp(GuardedCarrier& carrier, const RestPose& relaxed, const RestPose& turned,
               double travel);

}  // namespace assembly_cell
