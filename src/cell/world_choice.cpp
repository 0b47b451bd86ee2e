// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/world_choice.h"

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/dynamics/simulation.h"
#ifdef ASSEMBLY_CELL_MUJOCO
#include "assembly_cell/second_world/second_world.h"
#endif

namespace assembly_cell {
namespace {

void checkEngine(bool mujoco) {
#ifndef ASSEMBLY_CELL_MUJOCO
  if (mujoco) {
    throw InputError(
        "world: value mujoco: built without MuJoCo; install libmujoco-dev and build again");
  }
#endif
  (void)mujoco;
}

}  // namespace

WorldChoice parseWorld(const std::string& text, const std::string& source) {
  WorldChoice choice;
  if (text.find('{') == std::string::npos) {
    if (text != "exact" && text != "mujoco") {
      yaml::refuse(source, "world", text, "give exact, mujoco or {engine: mujoco, ...}");
    }
    choice.mujoco = text == "mujoco";
  } else {
    yaml::Section in(yaml::loadYaml(text, source), "world", source);
    choice.mujoco = in.choice("engine", {"mujoco"}) == "mujoco";
    SoftContact& c = choice.contact;
    c.time_step = in.number("time_step", 1e-6, 1e-3, c.time_step);
    c.facets = static_cast<int>(in.integer("facets", 16, 4096, c.facets));
    c.contact_time = in.number("contact_time", 1e-6, 0.1, c.contact_time);
    c.impedance = in.number("impedance", 0.5, 0.9999, c.impedance);
    c.friction_ratio = in.number("friction_ratio", 0.1, 1000.0, c.friction_ratio);
    if (in.optional("chamfer")) c.chamfer = in.number("chamfer", 0.0, 0.01, 0.0);
    in.finish();
  }
  checkEngine(choice.mujoco);
  return choice;
}

std::unique_ptr<SimulatorBackend> makeWorld(const Scenario& scenario, const WorldChoice& choice) {
  checkEngine(choice.mujoco);
#ifdef ASSEMBLY_CELL_MUJOCO
  if (choice.mujoco) return std::make_unique<MujocoSimulation>(scenario, choice.contact);
#endif
  return std::make_unique<Simulation>(scenario);
}

}  // namespace assembly_cell
