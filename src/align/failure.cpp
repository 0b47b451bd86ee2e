// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/failure.h"

#include <iterator>

namespace assembly_cell {

const char* toString(AlignFailure failure) {
  static constexpr const char* kNames[] = {
      "aligned",        "in_contact",    "force_limit",  "sensor_saturated",  "not_still",
      "not_arrived",    "no_contact",    "gave_way",     "press_not_held",    "stuck",
      "time_limit",     "zero_shifted",  "wedged",       "edge_in_hole",      "both_edges",
      "not_free",       "too_uncertain", "no_reading",   "no_plane_reading",  "no_hole_under_edge",
      "one_edge_only",  "not_double",    "lost_contact", "edge_not_resolved", "not_settled",
      "sensor_signs",   "no_pose",       "not_inserted", "too_tight",         "jammed",
      "cancelled",      "no_data",       "stopped",      "edge_outside",      "not_seated",
      "wrong_mechanism"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(AlignFailure::kCount));
  return kNames[static_cast<int>(failure)];
}

}  // namespace assembly_cell
