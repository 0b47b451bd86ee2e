// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

// A complete scenario of which the cases below change one thing each.
inline constexpr const char* kBase = R"(name: base
duration: 0.3
gravity: 9.8
peg: {radius: 0.025, half_height: 0.030, mass: 0.395, inertia_transverse: 2.5e-4,
      inertia_axial: 1.0e-4, coupling_height: 0.050, exciter_height: 0.056}
hole: {radius: 0.0251}
carrier: {mass: 0.395, inertia: 0.081, stiffness: [1, 2, 3], damping: [4, 5, 6],
          rest: {x: 0.001, y: 0.002, yaw: 0.3}}
coupling:
  stiffness: {diagonal: [10, 20, 30, 40, 50, 60], k26: 7, k35: -8}
  damping: {diagonal: [1, 2, 3, 4, 5, 6], c26: 0.7, c35: -0.8}
  rest: {z: 0.075, theta: 1.6, phi: 0.02}
friction: {static: 0.3, sliding: 0.2}
contact: {law: viscous, rate: 700}
)";

inline std::string errorOf(const std::string& yaml,
                           const std::vector<std::string>& overrides = {}) {
  try {
    parseScenario(yaml, "file.yaml", overrides);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

inline Scenario with(const std::vector<std::string>& overrides) {
  return parseScenario(kBase, "file.yaml", overrides);
}

}  // namespace assembly_cell
