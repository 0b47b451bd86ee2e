// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>

#include "assembly_cell/dynamics/simulator_backend.h"
#include "assembly_cell/dynamics/soft_contact.h"

namespace assembly_cell {

/// What simulates the mechanism.
struct WorldChoice {
  bool mujoco = false;  ///< false: `Simulation`
  SoftContact contact;  ///< of MuJoCo
};

/// "exact", "mujoco", or a YAML mapping as "{engine: mujoco, facets: 512}", see
/// docs/reference/interfaces.md. `source` names it in messages. Throws InputError, also for an
/// engine that this build has not.
WorldChoice parseWorld(const std::string& text, const std::string& source);

/// Throws InputError where the world refuses the scenario.
std::unique_ptr<SimulatorBackend> makeWorld(const Scenario& scenario, const WorldChoice& choice);

}  // namespace assembly_cell
