// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <array>
#include <string>
#include <vector>

#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// Parameters of the simulator.
struct SimulatorSettings {
  std::string scenario, mismatch, world = "exact";
  std::vector<std::string> overrides;  ///< of the scenario
  CellParameters cell;                 ///< numbers of sensors and samples
  bool publish_truth = true;
  bool lockstep = false, paused = false;
  bool follow_motion = false;                       ///< an arm moves the carrier
  std::vector<std::string> participants;            ///< of the lockstep
  double ack_timeout = 10.0, start_timeout = 60.0;  ///< wall clock [s]
  double real_time_factor = 1.0;
  double max_offset = 0.1;                           ///< default of workspace [m]
  std::array<double, 6> workspace{};                 ///< x from, to, y from, to, z from, to [m]
  double max_speed = 0.25, max_acceleration = 10.0;  ///< of the carrier [m/s], [m/s²]
  GuardLimits limits;
  LeaseMode lease = LeaseMode::kAuto;
};
void fields(FieldList& f, SimulatorSettings& s);

/// Reads all private parameters of the node. Throws InputError, also for unknown ones.
SimulatorSettings readSimulatorSettings(const ros::NodeHandle& pnh);

/// What the simulator simulates.
struct SimulatorSetup {
  Scenario scenario;            ///< ground truth
  CellParameters cell;          ///< ground truth
  CellDescription description;  ///< nominal
  Pose X_HB;                    ///< carrier's base in the true hole, by the scenario
  double nominal_height = 0.0;  ///< of the base over the hole, by the scenario's file [m]
  Braking braking;
  std::string mismatch;                 ///< model errors drawn for this run, YAML; empty: none
  std::vector<std::string> part_pairs;  ///< others than peg and hole that can meet
  bool peg_meets_hole = true;           ///< false: no search for contacts
};
/// urdf: text of the robot description. Throws InputError.
SimulatorSetup loadSimulatorSetup(const SimulatorSettings& settings, const std::string& urdf);

}  // namespace assembly_cell::ros_bridge
