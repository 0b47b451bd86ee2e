// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

namespace assembly_cell {

/// What is free in the second world: nothing of it is known to strategies or estimators.
/// docs/results/second_world.md shows what becomes of an alignment with each.
struct SoftContact {
  double time_step = 1e-4;  ///< of the engine, at most [s]; samples end steps
  int facets = 256;         ///< of the bore
  /// Time constant in which the engine lets a penetration decay [s]; at least two steps count, the
  /// engine sees to that. With `impedance` this is how stiff a contact is. Ten steps: what stops
  /// within one or two knocks, and neighbouring facets pinch the edge
  /// (docs/results/second_world.md).
  double contact_time = 1e-3;
  /// How much of a contact's force comes from the constraint, 0.5 soft to 0.9999 hard.
  double impedance = 0.99;
  /// How much harder friction holds along a contact than the contact holds across: creep under a
  /// constant load falls with it; more makes the solver slower.
  double friction_ratio = 10.0;
  /// Of the hole's rim, 45°, so wide and so deep [m], in place of the one that the scenario has
  /// and that strategies know of.
  std::optional<double> chamfer;
};

}  // namespace assembly_cell
