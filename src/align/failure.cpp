// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/failure.h"

namespace assembly_cell {
namespace {

using F = AlignFailure;

// Another attempt: touch and twin_force where a retreat frees the peg and another place may help,
// vibration wherever it need not end in the same way. Another strategy: unless it would meet the
// failure as well; in `auto` also not where the peg isn't free, its carrier can't move, it is too
// large, or the time is up. A converter too coarse for twin_force may do for vibratory.
//
// An attempt of vibration and single_contact next differ in two rows. not_still: the retreat may
// help, but single_contact starts from the same place again. time_limit: an attempt has no time
// left, but single_contact has where it was the insertion's limit.
// clang-format off
constexpr FailureTraits kTraits[] = {
    //                                           another attempt of      followed by
    //                                           touch  twin_   vibra-   single_ twin_   vibra-
    //                                                  force   tion     contact force   tory
    {F::kNone,             "aligned",             false, false,  false,  false,  false,  false},
    // moves and press
    {F::kInContact,        "in_contact",          false, false,  true,   true,   false,  false},
    {F::kForceLimit,       "force_limit",         true,  true,   true,   true,   true,   true },
    {F::kSensorSaturated,  "sensor_saturated",    true,  true,   true,   true,   true,   true },
    {F::kNotStill,         "not_still",           true,  true,   true,   false,  false,  true },
    {F::kNotArrived,       "not_arrived",         false, false,  true,   true,   false,  false},
    {F::kNoContact,        "no_contact",          false, false,  false,  false,  false,  false},
    {F::kGaveWay,          "gave_way",            false, true,   true,   true,   true,   true },
    {F::kPressNotHeld,     "press_not_held",      false, true,   true,   true,   true,   true },
    {F::kStuck,            "stuck",               false, false,  true,   true,   false,  false},
    {F::kTimeLimit,        "time_limit",          false, false,  false,  true,   false,  false},
    {F::kZeroShifted,      "zero_shifted",        false, false,  true,   true,   true,   true },
    // contacts and hole
    {F::kWedged,           "wedged",              true,  true,   true,   true,   true,   true },
    {F::kEdgeInHole,       "edge_in_hole",        false, false,  true,   true,   true,   true },
    {F::kBothEdges,        "both_edges",          false, true,   true,   true,   true,   true },
    {F::kNotFree,          "not_free",            true,  true,   true,   true,   true,   true },
    {F::kTooUncertain,     "too_uncertain",       false, false,  false,  false,  false,  true },
    {F::kNoReading,        "no_reading",          false, false,  false,  false,  false,  true },
    {F::kNoPlaneReading,   "no_plane_reading",    true,  true,   true,   true,   true,   true },
    {F::kNoHoleUnderEdge,  "no_hole_under_edge",  true,  false,  true,   true,   true,   true },
    {F::kOneEdgeOnly,      "one_edge_only",       false, false,  true,   true,   true,   true },
    {F::kNotDouble,        "not_double",          false, false,  true,   true,   true,   true },
    {F::kLostContact,      "lost_contact",        false, false,  true,   true,   true,   true },
    {F::kEdgeNotResolved,  "edge_not_resolved",   false, false,  true,   true,   true,   true },
    {F::kNotSettled,       "not_settled",         false, true,   true,   true,   true,   true },
    {F::kSensorSigns,      "sensor_signs",        false, false,  true,   true,   true,   true },
    {F::kNoPose,           "no_pose",             false, true,   true,   true,   true,   true },
    {F::kNotInserted,      "not_inserted",        true,  true,   true,   true,   true,   true },
    {F::kTooTight,         "too_tight",           false, false,  true,   true,   false,  false},
    // insertion
    {F::kJammed,           "jammed",              false, false,  true,   true,   true,   true },
    // the plant and its evaluation: cancelled to edge_outside reach no strategy
    {F::kCancelled,        "cancelled",           false, false,  false,  false,  false,  false},
    {F::kNoData,           "no_data",             false, false,  false,  false,  false,  false},
    {F::kStopped,          "stopped",             false, false,  false,  false,  false,  false},
    {F::kEdgeOutside,      "edge_outside",        false, false,  false,  false,  false,  false},
    {F::kNotSeated,        "not_seated",          false, false,  true,   true,   true,   true },
    {F::kWrongMechanism,   "wrong_mechanism",     false, false,  true,   true,   true,   true },
};
// clang-format on

constexpr bool isComplete() {
  std::size_t row = 0;
  for (const FailureTraits& traits : kTraits) {
    if (traits.failure != static_cast<AlignFailure>(row++)) return false;
  }
  return row == static_cast<std::size_t>(AlignFailure::kCount);
}
static_assert(isComplete(), "a row for each failure, in the order of AlignFailure");

}  // namespace

const FailureTraits& traitsOf(AlignFailure failure) { return kTraits[static_cast<int>(failure)]; }

const char* toString(AlignFailure failure) { return traitsOf(failure).name; }

}  // namespace assembly_cell
