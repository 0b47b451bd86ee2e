// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

namespace assembly_cell {

/// Contact parameters of the MuJoCo backend `MujocoSimulation`. Strategies and estimators don't
/// receive them. Influence of each on an alignment: docs/results/second_world.md.
struct SoftContact {
  double time_step = 1e-4;  ///< maximum step of the engine [s]; samples end steps
  int facets = 256;         ///< boxes around the bore
  /// Time constant of the decay of a penetration [s]; the engine uses at least two steps. Together
  /// with `impedance` it sets the stiffness of a contact. Default: ten steps; with one or two, an
  /// impact stops within them and neighbouring facets pinch the edge
  /// (docs/results/second_world.md).
  double contact_time = 1e-3;
  /// Constraint impedance of MuJoCo's solimp, 0.5 soft to 0.9999 hard.
  double impedance = 0.99;
  /// MuJoCo's impratio: impedance of friction over that of the normal direction. A larger ratio
  /// reduces creep under a constant load and slows the solver down.
  double friction_ratio = 10.0;
  /// Width and depth of a 45° chamfer of the hole [m], in place of the scenario's, which the
  /// strategies use.
  std::optional<double> chamfer;
};

}  // namespace assembly_cell
